// the catalogue's filter: an expression, parsed into a test of a row; what it does not understand,
// it says
"use strict";
(() => {
  const TOKEN =
    /\s*(?:"([^"]*)"|(<=|>=|==|!=|<>|≤|≥|≠|&&|\|\||[()<>=,:])|([^\s()<>=!,:≤≥≠"&|]+|[!&|]))/gu;
  const SAME = { "==": "=", ":": "=", "<>": "!=", "≠": "!=", "≤": "<=", "≥": ">=" };
  const COMPARE = {
    "<": (a, b) => a < b,
    ">": (a, b) => a > b,
    "<=": (a, b) => a <= b,
    ">=": (a, b) => a >= b,
  };
  const plain = (text) => text.toLowerCase().replaceAll("_", " ");
  class Wrong extends Error {}

  /* options: columns [{key, label}], read {key: (k) => value}, words(k): the text that words are
     looked for in -> {test(k), parts: [{text, test}]}, or throws an Error that says what is not
     understood

       expression = both { "or" both }      both = one { ["and"] one }
       one = "not" one | "(" expression ")" | column comparison value | word               */
  Fclib.parseFilter = (text, { columns, read, words }) => {
    const tokens = [];
    const parts = [];
    TOKEN.lastIndex = 0;
    while (TOKEN.lastIndex < text.trimEnd().length) {
      const found = TOKEN.exec(text);
      if (!found) throw new Wrong(`${text.slice(TOKEN.lastIndex)} is not understood`);
      const [whole, quoted, sign, word] = found;
      tokens.push({
        quoted: quoted !== undefined,
        text: quoted ?? SAME[sign] ?? sign ?? word,
        from: found.index + whole.length - whole.trimStart().length,
        to: TOKEN.lastIndex,
      });
    }
    // by key or by label, whose words are tokens of their own: "best solver", "best_solver"
    const names = new Map(
      columns.flatMap((c) => [
        [plain(c.label), c],
        [plain(c.key), c],
      ]),
    );
    const longest = Math.max(...[...names.keys()].map((name) => name.split(" ").length));
    let at = 0;
    const peek = (k = 0) => tokens[at + k];
    const isWord = (word, k = 0) =>
      peek(k) && !peek(k).quoted && peek(k).text.toLowerCase() === word;
    const isSign = (k = 0) =>
      peek(k) && !peek(k).quoted && ["=", "!=", ...Object.keys(COMPARE)].includes(peek(k).text);
    const columnHere = () => {
      for (let count = longest; count > 0; count--) {
        const own = tokens.slice(at, at + count);
        const name = own.map((one) => plain(one.text)).join(" ");
        if (own.length === count && !own.some((one) => one.quoted) && names.has(name))
          return [names.get(name), count];
      }
      return null;
    };
    const known = () => columns.map((c) => c.label).join(", ");
    const note = (from, to, test) => {
      parts.push({ text: text.slice(from, to).trim(), test });
      return test;
    };

    const condition = () => {
      const first = peek();
      const found = columnHere();
      if (found && isSign(found[1])) {
        const [column] = found;
        at += found[1];
        const { text: sign } = tokens[at++];
        const value = tokens[at++];
        if (!value || (!value.quoted && (value.text === ")" || SIGNS.has(value.text))))
          throw new Wrong(`${column.label} ${sign} needs a value`);
        let wanted = value.text;
        let end = value.to;
        if (!value.quoted && !Number.isNaN(Number(wanted)) && peek() && !peek().quoted) {
          const after = peek(isWord(",") ? 1 : 0);
          if (isWord("%")) {
            end = tokens[at++].to;
            wanted += "%";
          } else if (
            /^\d{1,3}$/.test(wanted) &&
            after &&
            !after.quoted &&
            /^\d{3}$/.test(after.text)
          )
            throw new Wrong(
              `${wanted} and ${after.text}: a number is written as one, ${wanted}${after.text}`,
            );
        }
        const of = read[column.key];
        const bound = Number(wanted.replace(/%$/, "")) / (wanted.endsWith("%") ? 100 : 1);
        if (COMPARE[sign]) {
          if (wanted === "" || Number.isNaN(bound))
            throw new Wrong(`${wanted} is no number, and ${column.label} ${sign} needs one`);
          return note(
            first.from,
            end,
            (k) => typeof of(k) === "number" && COMPARE[sign](of(k), bound),
          );
        }
        // few values stand in many rows: each is compared once
        const target = plain(wanted);
        const seen = new Map();
        const same = (v) =>
          wanted === ""
            ? v === null || v === undefined || v === ""
            : v === bound ||
              (v !== null &&
                v !== undefined &&
                plain(v === true ? "yes" : v === false ? "no" : String(v)) === target);
        const equal = (v) => {
          if (!seen.has(v)) seen.set(v, same(v));
          return seen.get(v);
        };
        return note(first.from, end, (k) => equal(of(k)) === (sign === "="));
      }
      if (isSign(0)) throw new Wrong(`${first.text} stands without a column before it`);
      at++;
      if (isSign(0) && !first.quoted && !Number.isNaN(Number(first.text)))
        throw new Wrong(
          `${first.text} stands before ${peek().text}: the column comes first, as in contacts > 50`,
        );
      if (isSign(0)) throw new Wrong(`there is no column ${first.text}; there are: ${known()}`);
      if (!first.quoted && /^[!&|,]$/.test(first.text))
        throw new Wrong(`${first.text} is not understood; and, or, not, != are`);
      const part = first.text.toLowerCase();
      return note(first.from, first.to, (k) => words(k).includes(part));
    };
    const one = () => {
      if (isWord("not")) {
        at++;
        if (!peek()) throw new Wrong("not needs what it denies");
        const test = one();
        return (k) => !test(k);
      }
      if (isWord("(")) {
        at++;
        const test = expression();
        if (!isWord(")")) throw new Wrong("a bracket ( is not closed");
        at++;
        return test;
      }
      if (!peek() || isWord(")") || isWord("or") || isWord("||") || isWord("and") || isWord("&&"))
        throw new Wrong(
          peek()
            ? `${peek().text} stands where a word or a condition should`
            : "something is missing at the end",
        );
      return condition();
    };
    const both = () => {
      const tests = [one()];
      while (peek() && !isWord("or") && !isWord("||") && !isWord(")")) {
        if (isWord("and") || isWord("&&") || isWord(",")) at++;
        tests.push(one());
      }
      return tests.length === 1 ? tests[0] : (k) => tests.every((test) => test(k));
    };
    const expression = () => {
      const tests = [both()];
      while (isWord("or") || isWord("||")) {
        at++;
        tests.push(both());
      }
      return tests.length === 1 ? tests[0] : (k) => tests.some((test) => test(k));
    };
    if (!tokens.length) return { test: () => true, parts };
    const test = expression();
    if (peek()) throw new Wrong(`${peek().text} is not understood here`);
    return { test, parts };
  };
  const SIGNS = new Set(["=", "!=", ...Object.keys(COMPARE), "(", ",", "&&", "||"]);
})();
