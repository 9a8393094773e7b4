// What ESLint looks for in JavaScript. Prettier has the style; package.json has its settings.
import js from "@eslint/js";

// of a page
const page = [
  ...["document", "window", "location", "history", "navigator", "localStorage", "crypto"],
  ...["innerWidth", "innerHeight", "devicePixelRatio", "scrollTo", "matchMedia", "print"],
  ...["addEventListener", "getComputedStyle", "getSelection", "requestAnimationFrame"],
  ...["Event", "Blob", "Response", "DecompressionStream", "IntersectionObserver"],
  ...["ResizeObserver", "DOMParser", "atob", "Plotly", "DataTable", "Fclib", "fclib"],
];
// of pages, workers and Node alike
const both = [
  ...["console", "performance", "setTimeout", "clearTimeout", "setInterval", "clearInterval"],
  ...["WorkerGlobalScope", "postMessage", "self"],
  ...["URL", "URLSearchParams", "TextDecoder", "TextEncoder", "fetch", "Worker"],
];
const known = (names) => Object.fromEntries(names.map((name) => [name, "readonly"]));

export default [
  js.configs.recommended,
  {
    linterOptions: { reportUnusedDisableDirectives: "error" },
    languageOptions: { ecmaVersion: 2024, globals: known(both) },
    rules: {
      "array-callback-return": "error",
      eqeqeq: "error",
      "max-len": ["error", { code: 100 }],
      "no-implicit-globals": "error",
      "no-shadow": "error",
      "no-unused-vars": ["error", { argsIgnorePattern: "^_", ignoreRestSiblings: true }],
      "no-use-before-define": ["error", { functions: false, variables: false }],
      "no-var": "error",
      "object-shorthand": "error",
      "one-var": ["error", "never"],
      "prefer-const": "error",
      "prefer-template": "off",
    },
  },
  {
    // classic scripts: from a folder of files a browser loads no modules
    files: ["**/report/assets/**/*.js", "**/site/assets/*.js"],
    languageOptions: { sourceType: "script", globals: known(page) },
    rules: { strict: ["error", "global"] },
  },
  {
    files: ["**/report/assets/core.js"],
    languageOptions: { globals: { Fclib: "off" } },
    rules: { "no-unused-vars": "off", "no-implicit-globals": "off" },
  },
  {
    files: ["**/fclib-worker.js"],
    languageOptions: { globals: { onmessage: "writable" } },
  },
  {
    files: ["**/*.mjs"],
    languageOptions: { globals: known(["process", "Buffer"]) },
  },
];
