// tables by DataTables: sorted by their heads, searched, a page of rows at a time, saved as CSV
"use strict";
(() => {
  const { h, number } = Fclib;
  const none = (v) => v === null || v === undefined || v === "";
  const words = new Intl.Collator(undefined, { numeric: true }).compare;
  const compare = (a, b) =>
    typeof a === "number" && typeof b === "number" ? a - b : words(String(a), String(b));
  // what is not there stays last, up and down
  const order = (sign) => (a, b) => (none(a) || none(b) ? none(a) - none(b) : sign * compare(a, b));
  DataTable.type("value", { order: { asc: order(1), desc: order(-1) } });
  DataTable.ext.errMode = "throw";

  /* options: columns [{key, label, type, title, head, wrap, value(row), cell(row), format(value)}],
     rows, caption, page: rows a page, sort: {key, down}, at: page, q: words to look for,
     search: whether it has a field for them, onstate({sort, at, q}), name: of the CSV,
     largest: numbers fall at the first click */
  Fclib.table = ({
    columns,
    rows,
    caption = "Table",
    page = 50,
    sort,
    at = 0,
    q = "",
    search = rows.length > 15,
    onstate,
    name,
    largest,
  }) => {
    const value = (column, row) => (column.value ? column.value(row) : row[column.key]);
    const numeric = columns.map(
      (c) =>
        c.type === "number" ||
        (c.type === undefined && typeof value(c, rows[0] || {}) === "number"),
    );
    const table = h(
      "table",
      { class: "compact hover" },
      h("caption", {}, caption),
      h(
        "thead",
        {},
        h(
          "tr",
          {},
          columns.map((c) => h("th", { title: c.title }, c.label)),
        ),
      ),
    );
    const box = h(
      "div",
      { class: columns.length < 4 && !columns.some((c) => c.wrap) && "narrow" },
      table,
    );
    const many = rows.length > page;
    const wide = columns.length > 12;
    const csv = {
      extend: "csvHtml5",
      text: "↓ CSV",
      filename: (name || caption).replaceAll("/", "-"),
      title: null,
      bom: false,
      footer: false,
      fieldBoundary: '"',
      exportOptions: {
        orthogonal: "raw",
        stripHtml: false,
        decodeEntities: false,
        format: {
          header: (text, k) =>
            typeof columns[k].key === "string" ? columns[k].key : columns[k].label,
        },
      },
    };
    // on a phone the rows come first
    const above = wide && !Fclib.isNarrow();
    const buttons = [
      csv,
      ...(wide
        ? [
            {
              extend: "colvis",
              text: "columns",
              background: false,
              collectionLayout: "three-column",
            },
          ]
        : []),
    ];
    const api = new DataTable(table, {
      data: rows,
      autoWidth: false,
      deferRender: true,
      caption: null,
      pageLength: page,
      displayStart: at * page,
      // a table that is not searched needs no words of all its rows
      searching: search,
      search: { search: q },
      order: columns.flatMap((c, k) =>
        sort && String(c.key) === String(sort.key) ? [[k, sort.down ? "desc" : "asc"]] : [],
      ),
      columns: columns.map((c, k) => ({
        name: String(c.key),
        type: "value",
        searchable: !numeric[k],
        cellType: c.head ? "th" : "td",
        className: `${numeric[k] ? "right" : "left"}${c.wrap ? " wrap" : ""}`,
        orderSequence: numeric[k] && largest ? ["desc", "asc"] : ["asc", "desc"],
        createdCell: (cell) => c.head && cell.setAttribute("scope", "row"),
        // what is shown is a node, so that no text is taken for HTML
        data: (row, kind) => {
          const own = value(c, row) ?? null;
          if (kind === "display")
            return h("span", {}, c.cell ? c.cell(row) : (c.format || number)(own));
          return kind === "raw" || kind === "filter" ? (none(own) ? "" : String(own)) : own;
        },
      })),
      language: {
        info: "_START_–_END_ of _TOTAL_",
        infoEmpty: "none",
        infoFiltered: "(of _MAX_)",
        emptyTable: "none",
        zeroRecords: "none",
        thousands: "",
        search: "search",
        aria: {
          paginate: {
            first: "First page",
            previous: "Previous page",
            next: "Next page",
            last: "Last page",
            number: "Page ",
          },
        },
      },
      layout: {
        topStart: above ? { buttons } : null,
        topEnd: search ? "search" : null,
        bottomStart: !above && (wide || name || rows.length > 7) ? { buttons } : null,
        bottomEnd: many ? { info: {}, paging: { buttons: 5 } } : null,
      },
    });
    const scroll = table.closest(".dt-layout-table");
    Fclib.set(scroll, { tabindex: 0, role: "region", "aria-label": caption });
    // several tables of a page are told apart
    for (const pages of api.table().container().querySelectorAll("nav"))
      Fclib.set(pages, { "aria-label": `Pages of: ${caption}` });
    if (onstate)
      api.on("draw.dt", () => {
        const [first] = api.order();
        onstate({
          sort: first && { key: columns[first[0]].key, down: first[1] === "desc" },
          at: api.page(),
          q: api.search(),
        });
      });
    box.api = api;
    box.update = (found) => {
      api.clear().rows.add(found).draw();
    };
    return box;
  };

  /* the libraries that a page carries, with their licences */
  Fclib.libraries = (list) =>
    Fclib.table({
      caption: "Shipped with this site, each under its own licence",
      rows: list,
      columns: [
        { key: "name", label: "library", head: true },
        { key: "version", label: "version" },
        { key: "purpose", label: "for" },
        { key: "package", label: "from the package" },
        {
          key: "licence",
          label: "licence",
          cell: (one) =>
            one.text.startsWith("assets/")
              ? h("a", { href: one.text }, one.licence)
              : h("details", {}, h("summary", {}, one.licence), h("pre", {}, one.text)),
        },
      ],
    });
})();
