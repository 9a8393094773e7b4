// what one takes along: files with their SHA-256, lines to copy, how to cite, a list of what is
// filtered
"use strict";
(() => {
  const { h, number, copyable, facts } = Fclib;
  const size = (bytes) =>
    bytes === undefined
      ? ""
      : bytes < 1e6
        ? `${number(bytes / 1e3)} kB`
        : `${number(bytes / 1e6)} MB`;
  const CHUNK = 100;
  /* digest, files and names of a row of the catalogue */
  Fclib.fileRecord = async (k) => (await Fclib.load(`files/${Math.floor(k / CHUNK)}`))[k % CHUNK];

  /* the files of a problem: here, at an address, or how to make them */
  Fclib.takeIt = (id, record, buildable) => {
    const files = record.files || [];
    const there = files.filter((one) => one.href);
    const build = `fclib collection build ${id} --out collection`;
    return [
      h("h2", { id: "take" }, "Take it"),
      there.length
        ? h(
            "ul",
            { class: "files" },
            there.map((one) =>
              h(
                "li",
                {},
                h(
                  "a",
                  {
                    href: one.href,
                    download: one.href.startsWith("files/") ? one.path.split("/").pop() : null,
                  },
                  one.path.split("/").pop(),
                ),
                ` ${one.what}, ${size(one.bytes)} `,
                h(
                  "details",
                  { class: "small" },
                  h("summary", {}, "SHA-256"),
                  h("code", { class: "sum" }, one.sha256),
                ),
              ),
            ),
          )
        : null,
      there.length
        ? h(
            "details",
            {},
            h("summary", {}, "Verify what came"),
            copyable(
              there
                .map((one) => `echo "${one.sha256}  ${one.path.split("/").pop()}" | sha256sum -c`)
                .join("\n"),
              "the check of the sums",
            ),
          )
        : null,
      buildable
        ? [
            h(
              "p",
              { class: "small" },
              there.length
                ? "Or make it, from the stored state of its simulation:"
                : "This site holds no files. One command makes this problem, from the stored " +
                    "state of its simulation:",
            ),
            copyable(build, "the command"),
          ]
        : !there.length
          ? h(
              "p",
              {},
              "This site has no file of it: who made this report has one. A file is of the same " +
                "problem if ",
              h("code", {}, "fclib.digest(fclib.read(FILE))"),
              " is this:",
            )
          : null,
      !there.length && files.length
        ? h(
            "p",
            { class: "small" },
            `What it gives should have, on the machine of this report: `,
            files.map((one, i) => [
              i ? "; " : "",
              `${one.path.split("/").pop()} `,
              h("code", { class: "sum" }, one.sha256),
            ]),
          )
        : null,
      record.digest
        ? facts([
            ["digest of the data", h("code", { class: "sum" }, record.digest)],
            ["version", record.version],
            ["license", record.license],
          ])
        : null,
    ]
      .flat()
      .filter(Boolean);
  };

  /* how to name it */
  Fclib.citeIt = (title, text, dois = []) =>
    [
      h("h2", { id: "cite" }, title),
      copyable(text, "BibTeX"),
      dois.length
        ? h(
            "p",
            { class: "small" },
            dois.map((one, i) => [
              i ? "; " : "",
              one.doi
                ? h("a", { href: `https://doi.org/${one.doi}`, rel: "noopener" }, one.title)
                : one.title,
            ]),
          )
        : null,
    ].filter(Boolean);
  Fclib.problemCitation = (id, record) =>
    Fclib.values.site.cite.problem
      .replaceAll("{id}", () => Fclib.escaped(id))
      .replaceAll("{key}", id.replaceAll(/[^\w-]+/g, "-"))
      .replaceAll("version {version}, ", record.version ? `version ${record.version}, ` : "")
      .replaceAll("{digest}", record.digest);

  /* the list of what the catalogue shows, for the commands that make or fetch it */
  Fclib.selection = (listed) => {
    const box = h("details", {}, h("summary", {}, "Take what is listed"));
    box.addEventListener("toggle", () => {
      const count = h(
        "p",
        { class: "small" },
        "A list of the names, a line each; the commands take it.",
      );
      box.replaceChildren(
        box.firstChild,
        count,
        h(
          "button",
          {
            type: "button",
            onclick: () =>
              Fclib.save(
                "selection.txt",
                `${listed()
                  .map((row) => row.id)
                  .join("\n")}\n`,
              ),
          },
          "↓ selection.txt",
        ),
        copyable(
          "fclib collection build --list selection.txt --out collection\nfclib collection " +
            "get --list selection.txt --from URL --out collection",
          "the commands",
        ),
      );
    });
    return box;
  };
})();
