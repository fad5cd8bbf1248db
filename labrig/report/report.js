// The button appears only where this runs. Without access to the clipboard, the text is selected.
const button = document.getElementById("copy-methods");
button.hidden = false;
button.addEventListener("click", async () => {
  const text = document.getElementById("methods-plain");
  try {
    await navigator.clipboard.writeText(text.textContent);
    button.textContent = "Copied";
  } catch {
    text.parentElement.open = true;
    getSelection().selectAllChildren(text);
    button.textContent = document.execCommand("copy") ? "Copied" : "Selected: copy with Ctrl-C";
  }
});
