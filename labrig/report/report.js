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
