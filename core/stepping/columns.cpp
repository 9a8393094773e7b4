#include "stepping/columns.hpp"

#include <algorithm>
#include <cstddef>
#include <numeric>

namespace fclib::stepping {

namespace {

/// The entries of a column, by rows in order.
struct Entries {
  std::vector<Index> rows;
  std::vector<double> values;
  std::span<const Index> row;
  std::span<const double> value;

  void read(const Columns& a, Index col) {
    const auto start = static_cast<std::size_t>(a.start(col));
    const auto count = static_cast<std::size_t>(a.start(col + 1)) - start;
    row = {a.i + start, count};
    value = {a.x + start, count};
    if (std::is_sorted(row.begin(), row.end())) return;
    std::vector<std::size_t> order(count);
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(),
                     [&](std::size_t i, std::size_t k) { return row[i] < row[k]; });
    rows.clear();
    values.clear();
    for (const std::size_t k : order) {
      rows.push_back(row[k]);
      values.push_back(value[k]);
    }
    row = rows;
    value = values;
  }
};

Matrix by_columns(Index rows, Index cols, std::size_t room) {
  Matrix made;
  made.storage = Storage::csc;
  made.rows = rows;
  made.cols = cols;
  made.p.reserve(static_cast<std::size_t>(cols) + 1);
  made.p.push_back(0);
  made.i.reserve(room);
  made.x.reserve(room);
  return made;
}

void close_column(Matrix& made) { made.p.push_back(static_cast<Index>(made.i.size())); }

}  // namespace

Columns columns_of(const Matrix& a) {
  return {a.rows, a.cols, a.p.empty() ? nullptr : a.p.data(), a.i.data(), a.x.data()};
}

void add_product(const Columns& a, std::span<const double> x, std::span<double> y) {
  for (Index col = 0; col < a.cols; ++col) {
    const double factor = x[static_cast<std::size_t>(col)];
    for (Index k = a.start(col); k < a.start(col + 1); ++k) y[a.i[k]] += a.x[k] * factor;
  }
}

double product(const Columns& a, Index col, std::span<const double> x) {
  double sum = 0;
  for (Index k = a.start(col); k < a.start(col + 1); ++k) sum += a.x[k] * x[a.i[k]];
  return sum;
}

Matrix sum(const Columns& a, double factor, const Columns& b) {
  Matrix made = by_columns(a.rows, a.cols, static_cast<std::size_t>(a.nnz() + b.nnz()));
  if (b.nnz() == 0) {
    for (Index col = 0; col < a.cols; ++col) made.p.push_back(a.start(col + 1));
    made.i.assign(a.i, a.i + a.nnz());
    made.x.assign(a.x, a.x + a.nnz());
    return made;
  }
  Entries own, others;
  for (Index col = 0; col < a.cols; ++col) {
    own.read(a, col);
    others.read(b, col);
    std::size_t i = 0, k = 0;
    while (i < own.row.size() || k < others.row.size()) {
      const bool first =
          k == others.row.size() || (i < own.row.size() && own.row[i] <= others.row[k]);
      const Index row = first ? own.row[i] : others.row[k];
      double total = 0;
      for (; i < own.row.size() && own.row[i] == row; ++i) total += own.value[i];
      for (; k < others.row.size() && others.row[k] == row; ++k) total += factor * others.value[k];
      if (total == 0) continue;
      made.i.push_back(row);
      made.x.push_back(total);
    }
    close_column(made);
  }
  return made;
}

Matrix chosen_entries(std::span<const double> values, std::span<const std::int64_t> number,
                      std::span<const Index> row, std::span<const Index> start, Index rows) {
  const std::size_t cols = start.size() - 1;
  Matrix made = by_columns(rows, static_cast<Index>(cols), number.size());
  for (std::size_t col = 0; col < cols; ++col) {
    for (auto k = static_cast<std::size_t>(start[col]);
         k < static_cast<std::size_t>(start[col + 1]); ++k) {
      const double value = values[static_cast<std::size_t>(number[k])];
      if (value == 0) continue;
      made.i.push_back(row[k]);
      made.x.push_back(value);
    }
    close_column(made);
  }
  return made;
}

Matrix part(const Columns& a, std::span<const Index> columns, std::span<const Index> number,
            Index rows) {
  std::size_t room = 0;
  for (const Index col : columns) room += static_cast<std::size_t>(a.start(col + 1) - a.start(col));
  Matrix made =
      by_columns(number.empty() ? a.rows : rows, static_cast<Index>(columns.size()), room);
  for (const Index col : columns) {
    for (Index k = a.start(col); k < a.start(col + 1); ++k) {
      const Index row = number.empty() ? a.i[k] : number[static_cast<std::size_t>(a.i[k])];
      if (row < 0) continue;
      made.i.push_back(row);
      made.x.push_back(a.x[k]);
    }
    close_column(made);
  }
  return made;
}

}  // namespace fclib::stepping
