// tables that sort by their heads and show one page of rows at a time
"use strict";
(() => {
  const { h, number } = Fclib;
  const compare = (a, b) => {
    const none = (v) => v === null || v === undefined || v === "";
    if (none(a) || none(b)) return none(a) - none(b) || 0;
    return typeof a === "number" && typeof b === "number" ? a - b : String(a).localeCompare(String(b), undefined, { numeric: true });
  };
  /* options: columns [{key, label, type, title, head, wrap, value(row), cell(row), format(value)}], rows, caption,
     page: rows a page, sort: {key, down}, at: page, onstate({sort, at}) */
  Fclib.table = (options) => {
    const state = { sort: options.sort || null, at: options.at || 0 };
    const size = options.page || 50;
    const value = (column, row) => column.value ? column.value(row) : row[column.key];
    const box = h("div", { class: options.columns.length < 4 && !options.columns.some((c) => c.wrap) && "narrow" }), body = h("tbody", {}), pager = h("div", { class: "pager" });
    let order = options.rows;
    const numeric = options.columns.map((c) => c.type === "number" || (c.type === undefined && typeof value(c, options.rows[0] || {}) === "number"));
    const heads = options.columns.map((column, k) => h("th", { scope: "col", class: numeric[k] && "right", title: column.title },
      h("button", { type: "button", onclick: () => {
        const down = state.sort && state.sort.key === column.key ? !state.sort.down : numeric[k] && Boolean(options.largest);
        state.sort = { key: column.key, down };
        state.at = 0;
        sort(); fill(); tell();
      } }, column.label)));
    const tell = () => options.onstate && options.onstate(state);
    const sort = () => {
      const column = state.sort && options.columns.find((c) => String(c.key) === String(state.sort.key));
      if (!column) { order = options.rows; return; }
      const sign = state.sort.down ? -1 : 1;
      // what is not there stays last
      order = options.rows.map((row, k) => [value(column, row), k, row]).sort((a, b) => {
        const missing = (v) => v === null || v === undefined;
        if (missing(a[0]) || missing(b[0])) return missing(a[0]) - missing(b[0]) || a[1] - b[1];
        return sign * compare(a[0], b[0]) || a[1] - b[1];
      }).map((entry) => entry[2]);
    };
    const fill = () => {
      const pages = Math.max(1, Math.ceil(order.length / size));
      state.at = Math.min(Math.max(0, state.at), pages - 1);
      options.columns.forEach((column, k) => {
        const own = state.sort && String(state.sort.key) === String(column.key);
        heads[k].setAttribute("aria-sort", own ? state.sort.down ? "descending" : "ascending" : "none");
      });
      body.replaceChildren(...order.slice(state.at * size, (state.at + 1) * size).map((row) => h("tr", {}, options.columns.map((column, k) => {
        const content = column.cell ? column.cell(row) : (column.format || number)(value(column, row));
        return h(column.head ? "th" : "td", { scope: column.head && "row", class: [numeric[k] && "right", column.wrap && "wrap"].filter(Boolean).join(" ") || null }, content);
      }))));
      pager.replaceChildren();
      if (pages > 1) {
        const go = (to) => { state.at = to; fill(); tell(); };
        const button = (text, to, name) => h("button", { type: "button", disabled: to < 0 || to >= pages || to === state.at, "aria-label": name, onclick: () => go(to) }, text);
        pager.append(button("«", 0, "First page"), button("‹", state.at - 1, "Previous page"),
          h("span", { "aria-live": "polite" }, `${state.at * size + 1}–${Math.min(order.length, (state.at + 1) * size)} of ${order.length}`),
          button("›", state.at + 1, "Next page"), button("»", pages - 1, "Last page"));
      }
    };
    box.append(h("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": options.caption || "Table" },
      h("table", {}, options.caption && h("caption", {}, options.caption), h("thead", {}, h("tr", {}, heads)), body)), pager);
    sort(); fill();
    box.update = (rows) => { options.rows = rows; state.at = 0; sort(); fill(); };
    box.rows = () => order;
    return box;
  };
})();
