// A link to a folded patch opens it.
const openTarget = () => {
  const target = document.getElementById(decodeURIComponent(location.hash.slice(1)));
  const details = target?.closest("details");
  if (details) {
    details.open = true;
    details.scrollIntoView();
  }
};
addEventListener("hashchange", openTarget);
openTarget();
for (const button of document.querySelectorAll(".open-all")) {
  button.hidden = false;
  button.addEventListener("click", () => {
    for (const details of document.querySelectorAll(".folded > details")) details.open = true;
  });
}

// Buttons appear only where this runs. Without access to the clipboard, the text is selected.
for (const methods of document.querySelectorAll(".methods")) {
  const button = methods.querySelector(".copy");
  const text = methods.querySelector(".plain");
  button.hidden = false;
  button.addEventListener("click", async () => {
    try {
      await navigator.clipboard.writeText(text.textContent);
      button.textContent = "Copied";
    } catch {
      text.parentElement.open = true;
      getSelection().selectAllChildren(text);
      button.textContent = document.execCommand("copy") ? "Copied" : "Selected: copy with Ctrl-C";
    }
  });
}
