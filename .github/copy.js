// Copies the code of a session without prompts and without output. The button of the generator
// copies the attribute data-clipboard-text if a button has it.
const PROMPTS = [/^\$ /, /^>>> /, /^\.\.\. ?/];

function copiedCode(text) {
  const lines = text.replace(/\n$/, "").split("\n");
  if (!lines.some((line) => /^(\$|>>>) /.test(line))) {
    return text;
  }
  const kept = [];
  let isContinued = false;
  for (const line of lines) {
    const prompt = PROMPTS.find((pattern) => pattern.test(line));
    if (prompt || isContinued || line.startsWith("# ")) {
      kept.push(prompt ? line.replace(prompt, "") : line);
    }
    isContinued = (Boolean(prompt) || isContinued) && line.endsWith("\\");
  }
  return kept.join("\n");
}

document.addEventListener(
  "click",
  (event) => {
    const button = event.target.closest("[data-clipboard-target]");
    if (button) {
      const code = document.querySelector(button.dataset.clipboardTarget);
      button.dataset.clipboardText = copiedCode(code.textContent);
    }
  },
  true,
);
