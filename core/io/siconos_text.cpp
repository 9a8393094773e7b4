#include "io/siconos_text.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>
#include <vector>

#include "io/replace_file.hpp"
#include "version.hpp"

namespace fclib {

namespace {

using Count = std::int64_t;

constexpr Count largest_index = std::numeric_limits<Index>::max();

// the numbers of Siconos for its storages and for the origins of a sparse matrix
enum : Count { text_dense = 0, text_blocks = 1, text_sparse = 2 };
enum : Count { origin_triplet = 1, origin_csc = 2, origin_csr = 3 };

// ---- the formulations as the format tells them apart

struct Layout {
  std::string_view kind;
  bool rolling;
  std::array<Index, 2> dimensions;
  int matrices = 0;  // 1: W, 2: M and H
};

/// Calls visit(field) for the matrices, or the vectors, that the format holds, in their order.
template <class P, class Member, class Visitor>
void for_each_stored(Visitor&& visit) {
  for_each_field<P>([&]<class Other>(const Field<P, Other>& field) {
    if constexpr (std::same_as<Other, Member>) {
      if (field.presence == Presence::required) visit(field);
    }
  });
}

std::vector<Layout> layouts() {
  std::vector<Layout> result;
  for_each_formulation([&]<class P>(std::type_identity<P>) {
    Layout layout{.kind = P::kind, .rolling = P::rolling, .dimensions = P::dimensions};
    for_each_stored<P, Matrix>([&](const auto&) { ++layout.matrices; });
    result.push_back(layout);
  });
  return result;
}

bool has_dimension(const Layout& layout, Index d) {
  return std::find(layout.dimensions.begin(), layout.dimensions.end(), d) !=
         layout.dimensions.end();
}

/// The layout of a kind; nothing where the kind is not given.
std::optional<Layout> layout_of(std::string_view kind) {
  if (kind.empty()) return std::nullopt;
  std::string known;
  for (const Layout& layout : layouts()) {
    if (layout.kind == kind) return layout;
    known += (known.empty() ? "" : ", ") + std::string(layout.kind);
  }
  throw Error(ErrorKind::option,
              "there is no kind '" + std::string(kind) + "'; there are: " + known, "kind");
}

// ---- reading ----------------------------------------------------------------------------------

/// A number that from_chars finds too small or too large: rounded, as by any reader, to what a
/// double holds next to it.
double beyond_range(std::string_view text) {
  long double value = 0;
  if (std::from_chars(text.data(), text.data() + text.size(), value).ec == std::errc()) {
    return static_cast<double>(value);
  }
  const bool small = text.find("e-") != text.npos || text.find("E-") != text.npos;
  return small ? 0.0 : std::numeric_limits<double>::infinity();
}

/// What stands in the file, shortened and without what a terminal should not get.
std::string quoted(std::string_view text) {
  constexpr std::size_t longest = 24;
  std::string result = "'";
  for (const char c : text.substr(0, longest)) result += c >= ' ' && c <= '~' ? c : '?';
  return result + (text.size() > longest ? "...'" : "'");
}

bool is_space(char c) { return c == ' ' || (c >= '\t' && c <= '\r'); }

/// "W", "the first matrix": what is being read, for messages.
using What = std::string_view;

/// A text and a place in it. All that is read says in which line it failed.
class Reader {
 public:
  explicit Reader(std::string_view text) : rest_(text) {}

  [[nodiscard]] Count line() const { return line_; }

  [[noreturn]] static void fail_at(Count line, const std::string& message) {
    throw Error(ErrorKind::file, message, "line " + std::to_string(line));
  }
  [[noreturn]] void fail(const std::string& message) const { fail_at(line_, message); }

  /// Whether nothing follows but white space.
  bool at_end() {
    skip_space();
    return rest_.empty();
  }

  std::string_view token(What what) {
    if (at_end()) fail("the file ends inside " + std::string(what));
    std::size_t size = 0;
    while (size < rest_.size() && !is_space(rest_[size])) ++size;
    const std::string_view result = rest_.substr(0, size);
    rest_.remove_prefix(size);
    return result;
  }

  /// What is left of the line, its end passed over.
  std::string_view rest_of_line() {
    count_line();
    const std::size_t size = std::min(rest_.find('\n'), rest_.size());
    const std::string_view result = rest_.substr(0, size);
    rest_.remove_prefix(std::min(size + 1, rest_.size()));
    ended_line_ = true;
    return result;
  }

  void literal(std::string_view expected, What what) {
    const std::string_view found = token(what);
    if (found != expected) {
      fail(quoted(found) + " stands in " + std::string(what) + " where '" + std::string(expected) +
           "' is expected");
    }
  }

  Index integer(What what, Count lowest, Count highest) {
    return in_range(token(what), what, lowest, highest);
  }

  Index in_range(std::string_view text, What what, Count lowest, Count highest) const {
    Count value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    const bool whole = end == text.data() + text.size();
    if (!whole || error == std::errc::invalid_argument) {
      fail(quoted(text) + " is not an integer (" + std::string(what) + ")");
    }
    if (error != std::errc() || value < lowest || value > highest) {
      fail(std::string(what) + " is " + std::string(text.substr(0, 24)) + ", but must be in " +
           std::to_string(lowest) + ".." + std::to_string(highest));
    }
    return static_cast<Index>(value);
  }

  double number(What what) {
    const std::string_view text = token(what);
    const std::string_view bare = text.substr(text.front() == '+' ? 1 : 0);
    double value = 0;
    const auto [end, error] = std::from_chars(bare.data(), bare.data() + bare.size(), value);
    if (end != bare.data() + bare.size() || error == std::errc::invalid_argument) {
      fail(quoted(text) + " is not a number (" + std::string(what) + ")");
    }
    if (error == std::errc::result_out_of_range) value = beyond_range(bare);
    if (!std::isfinite(value)) {
      fail(quoted(text) + " is not a finite number (" + std::string(what) + ")");
    }
    return value;
  }

  /// Fails where the file is too short for what it announces, before memory is asked for: each
  /// thing takes `bytes` characters at least. A small number is not worth it: reading on says
  /// better what is missing.
  void require_room(Count count, Count bytes, What what) const {
    constexpr Count small = 4096;
    if (count > small && count > static_cast<Count>(rest_.size()) / bytes + 1) {
      fail(std::string(what) + " has " + std::to_string(count) +
           " entries by its sizes, but the file ends before");
    }
  }

  /// White-space separated words up to the end, at most `most` of them.
  [[nodiscard]] Count words_left(Count most) const {
    Reader ahead = *this;
    Count count = 0;
    for (; count < most && !ahead.at_end(); ++count) ahead.token("");
    return count;
  }

 private:
  void count_line() {
    if (ended_line_) ++line_;
    ended_line_ = false;
  }
  void skip_space() {
    count_line();
    std::size_t size = 0;
    for (; size < rest_.size() && is_space(rest_[size]); ++size) {
      if (rest_[size] == '\n') ++line_;
    }
    rest_.remove_prefix(size);
  }

  std::string_view rest_;
  Count line_ = 1;
  bool ended_line_ = false;  // the line feed before rest_ is not counted yet
};

void read_numbers(Reader& in, Count count, What what, std::vector<double>& values) {
  in.require_room(count, 2, what);
  // an exact reserve for each of many blocks would copy all that is there each time
  if (values.empty()) values.reserve(static_cast<std::size_t>(count));
  for (Count k = 0; k < count; ++k) values.push_back(in.number(what));
}

Matrix read_dense(Reader& in, Index rows, Index cols, What what) {
  Matrix a{
      .storage = Storage::dense, .rows = rows, .cols = cols, .p = {}, .i = {}, .x = {}, .info = {}};
  const Index again[2] = {in.integer(what, 0, largest_index), in.integer(what, 0, largest_index)};
  if (again[0] != rows || again[1] != cols) {
    in.fail(std::string(what) + " is " + std::to_string(rows) + " x " + std::to_string(cols) +
            ", and " + std::to_string(again[0]) + " x " + std::to_string(again[1]));
  }
  read_numbers(in, static_cast<Count>(rows) * cols, what, a.x);
  return a;
}

/// Where the blocks of one side start: 0, then the cumulated sizes of the file.
std::vector<Index> read_block_starts(Reader& in, Index blocks, Index size, What what) {
  in.require_room(blocks, 2, what);
  std::vector<Index> starts{0};
  for (Index k = 0; k < blocks; ++k) starts.push_back(in.integer(what, starts.back(), size));
  if (starts.back() != size) {
    in.fail("the blocks of " + std::string(what) + " add up to " + std::to_string(starts.back()) +
            ", not to its size " + std::to_string(size));
  }
  return starts;
}

Matrix read_blocks(Reader& in, Index rows, Index cols, What what) {
  const Index count = in.integer(what, 0, largest_index);
  const Index block_rows = in.integer(what, 0, rows);
  const Index block_cols = in.integer(what, 0, cols);
  const std::vector<Index> row_starts = read_block_starts(in, block_rows, rows, what);
  const std::vector<Index> col_starts = read_block_starts(in, block_cols, cols, what);

  // rows of blocks after the last one that is not empty have no pointer
  const Index pointer_count = in.integer(what, count > 0 ? 2 : 0, Count{block_rows} + 1);
  const Index listed = in.integer(what, count, count);
  in.require_room(Count{pointer_count} + listed, 2, what);
  std::vector<Index> pointers;
  for (Index k = 0; k < pointer_count; ++k) {
    const Count lowest = k == 0 ? 0 : pointers.back();
    pointers.push_back(in.integer(what, lowest, k == 0 ? 0 : count));
  }
  if (!pointers.empty() && pointers.back() != count) {
    in.fail("the rows of blocks of " + std::string(what) + " have " +
            std::to_string(pointers.back()) + " of its " + std::to_string(count) + " blocks");
  }
  std::vector<Index> block_col;
  for (Index k = 0; k < listed; ++k) {
    block_col.push_back(in.integer(what, 0, Count{block_cols} - 1));
  }

  Matrix a{.storage = Storage::triplet,
           .rows = rows,
           .cols = cols,
           .p = {},
           .i = {},
           .x = {},
           .info = {}};
  for (std::size_t row = 0; row + 1 < pointers.size(); ++row) {
    for (Index block = pointers[row]; block < pointers[row + 1]; ++block) {
      const auto col = static_cast<std::size_t>(block_col[static_cast<std::size_t>(block)]);
      in.integer(what, block, block);
      const Count height = row_starts[row + 1] - row_starts[row];
      const Count width = col_starts[col + 1] - col_starts[col];
      read_numbers(in, height * width, what, a.x);
      for (Index j = col_starts[col]; j < col_starts[col + 1]; ++j) {
        for (Index i = row_starts[row]; i < row_starts[row + 1]; ++i) {
          a.i.push_back(i);
          a.p.push_back(j);
        }
      }
    }
  }
  return a;
}

/// "[triplet: ]R-by-C, nzmax: N nnz: N[, 1-norm: X]"
struct SparseHeader {
  bool triplet = false;
  Index nnz = 0;
};

SparseHeader read_sparse_header(Reader& in, Index rows, Index cols, What what) {
  const std::string name = "the sizes of " + std::string(what);
  SparseHeader header;
  std::string_view word = in.token(name);
  if (word == "triplet:") {
    header.triplet = true;
    word = in.token(name);
  }
  const std::string expected = std::to_string(rows) + "-by-" + std::to_string(cols) + ",";
  if (word != expected) {
    in.fail(quoted(word) + " stands in " + name + " where '" + expected + "' is expected");
  }
  in.literal("nzmax:", name);
  const Index most = in.integer(name, 0, largest_index);
  in.literal("nnz:", name);
  std::string_view nnz = in.token(name);
  if (nnz.ends_with(',')) nnz.remove_suffix(1);
  header.nnz = in.in_range(nnz, "the number of entries of " + std::string(what), 0, most);
  in.rest_of_line();
  return header;
}

Matrix read_sparse(Reader& in, Index rows, Index cols, What what) {
  const Index origin = in.integer("the origin of " + std::string(what), origin_triplet, origin_csr);
  in.rest_of_line();
  in.rest_of_line();  // the version of CSparse
  const SparseHeader header = read_sparse_header(in, rows, cols, what);
  if (header.triplet != (origin == origin_triplet)) {
    in.fail(std::string(what) + " is of origin " + std::to_string(origin) + ", but " +
            (header.triplet ? "" : "not ") + "a list of triplets");
  }
  Matrix a{.storage = Storage::triplet,
           .rows = rows,
           .cols = cols,
           .p = {},
           .i = {},
           .x = {},
           .info = {}};
  constexpr Count shortest_entry = 6;  // "0 : 1" and the end of a line
  in.require_room(header.nnz, shortest_entry, what);
  a.i.reserve(static_cast<std::size_t>(header.nnz));
  a.x.reserve(static_cast<std::size_t>(header.nnz));
  const auto read_value = [&] {
    in.literal(":", what);
    a.x.push_back(in.number(what));
  };
  if (header.triplet) {
    a.p.reserve(static_cast<std::size_t>(header.nnz));
    for (Index k = 0; k < header.nnz; ++k) {
      a.i.push_back(in.integer(what, 0, Count{rows} - 1));
      a.p.push_back(in.integer(what, 0, Count{cols} - 1));
      read_value();
    }
    return a;
  }

  // by rows, "col" numbers a row
  a.storage = origin == origin_csc ? Storage::csc : Storage::csr;
  const Index outer = origin == origin_csc ? cols : rows;
  const Index inner = origin == origin_csc ? rows : cols;
  constexpr Count shortest_line = 25;  // "col 0 : locations 0 to 0" and its end
  in.require_room(outer, shortest_line, what);
  a.p.reserve(static_cast<std::size_t>(outer) + 1);
  a.p.push_back(0);
  for (Index j = 0; j < outer; ++j) {
    in.literal("col", what);
    in.integer(what, j, j);
    in.literal(":", what);
    in.literal("locations", what);
    in.integer(what, a.p.back(), a.p.back());
    in.literal("to", what);
    a.p.push_back(1 + in.integer(what, Count{a.p.back()} - 1, Count{header.nnz} - 1));
    for (Index k = a.p[static_cast<std::size_t>(j)]; k < a.p.back(); ++k) {
      a.i.push_back(in.integer(what, 0, Count{inner} - 1));
      read_value();
    }
  }
  if (a.p.back() != header.nnz) {
    in.fail(std::string(what) + " has " + std::to_string(a.p.back()) + " entries, not " +
            std::to_string(header.nnz));
  }
  return a;
}

/// A matrix; `rows` and `cols` are its expected sizes, or -1. Blocks are left as triplets.
struct ReadMatrix {
  Matrix matrix;
  bool blocks = false;
  Count line = 1;  // of its sizes
};

ReadMatrix read_matrix(Reader& in, What what, Index expected_rows, Index expected_cols) {
  const Index storage = in.integer("the storage of " + std::string(what), text_dense, text_sparse);
  const std::string sizes = "the size of " + std::string(what);
  const auto require = [&](Index actual, Index expected, const char* side) {
    if (expected >= 0 && actual != expected) {
      in.fail(std::string(what) + " has " + std::to_string(actual) + " " + side + ", expected " +
              std::to_string(expected));
    }
  };
  const Index rows = in.integer(sizes, 0, largest_index);
  require(rows, expected_rows, "rows");
  const Index cols = in.integer(sizes, 0, largest_index);
  require(cols, expected_cols, "columns");
  const Count line = in.line();
  // a vector of each of these lengths follows: a file cannot announce more than it has room for
  in.require_room(rows, 2, what);
  in.require_room(cols, 2, what);
  ReadMatrix result{.matrix = {}, .blocks = storage == text_blocks, .line = line};
  if (storage == text_dense) result.matrix = read_dense(in, rows, cols, what);
  if (storage == text_blocks) result.matrix = read_blocks(in, rows, cols, what);
  if (storage == text_sparse) result.matrix = read_sparse(in, rows, cols, what);
  return result;
}

/// Whether a matrix may start here: three integers, the first a storage.
bool may_be_matrix(Reader in) {
  try {
    in.integer("", text_dense, text_sparse);
    in.integer("", 0, largest_index);
    in.integer("", 0, largest_index);
    return true;
  } catch (const Error&) {
    return false;
  }
}

/// The integer at the end of old files.
bool is_flag(std::string_view word) { return word == "0" || word == "1"; }

/// What a text may be at the sight of its first matrix, and, where d = 3 leaves open whether it
/// rolls, of how many words follow what both have.
Layout detect(const Reader& in, Index d, Index nc, const ReadMatrix& first) {
  const Count m = Count{d} * nc;
  const Matrix& a = first.matrix;
  const bool fits = a.rows == m && a.cols == m;
  // the vectors of a local problem, two coefficients a contact at most, and the flag
  const Count longest_local = m + 2 * Count{nc} + 1;
  const bool global =
      may_be_matrix(in) && (!fits || in.words_left(longest_local + 1) > longest_local);
  if (!global && !fits) {
    Reader::fail_at(first.line, "the first matrix is " + std::to_string(a.rows) + " x " +
                                    std::to_string(a.cols) + ", but " + std::to_string(nc) +
                                    " contacts of dimension " + std::to_string(d) + " make " +
                                    std::to_string(m) + " x " + std::to_string(m));
  }
  std::vector<Layout> candidates;
  for (const Layout& layout : layouts()) {
    if (layout.matrices == (global ? 2 : 1) && has_dimension(layout, d)) {
      candidates.push_back(layout);
    }
  }
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Layout& x, const Layout& y) { return x.rolling < y.rolling; });
  if (candidates.size() < 2) return candidates.front();
  Reader ahead = in;
  if (global) read_matrix(ahead, "the second matrix", a.rows, static_cast<Index>(m));
  const Count common = (global ? Count{a.rows} : 0) + m + nc;
  for (Count k = 0; k < common; ++k) {
    if (ahead.at_end()) return candidates.front();
    ahead.token("");
  }
  const Count more = ahead.words_left(Count{nc} + 2);
  const bool flag_alone = more == 1 && is_flag(ahead.token(""));
  const bool rolls = nc > 0 && (more == nc || more == nc + 1) && !flag_alone;
  return candidates[rolls ? 1 : 0];
}

template <class P>
P read_fields(Reader& in, Index d, Index nc, ReadMatrix first) {
  P problem;
  problem.spacedim = d;
  const auto m = static_cast<Index>(Count{d} * nc);
  Index n = 0;
  const auto length = [&](Dim dim) { return dim == Dim::n ? n : dim == Dim::m ? m : nc; };
  bool is_first = true;
  std::vector<std::pair<Matrix P::*, ReadMatrix>> matrices;
  for_each_stored<P, Matrix>([&](const auto& field) {
    if (is_first) {
      if (field.rows == Dim::n) n = first.matrix.rows;
      const Index side = length(field.rows);
      if (first.matrix.rows != side || first.matrix.cols != side) {
        Reader::fail_at(first.line, std::string(field.name) + " is " +
                                        std::to_string(first.matrix.rows) + " x " +
                                        std::to_string(first.matrix.cols) + ", expected " +
                                        std::to_string(side) + " x " + std::to_string(side));
      }
      matrices.emplace_back(field.member, std::move(first));
    } else {
      matrices.emplace_back(field.member,
                            read_matrix(in, field.name, length(field.rows), length(field.cols)));
    }
    is_first = false;
  });
  for_each_stored<P, Vector>([&](const Field<P, Vector>& field) {
    const Index size = length(field.rows);
    in.require_room(size, 2, field.name);
    Vector& values = problem.*field.member;
    values.resize(size);
    for (double& value : values) {
      value = in.number(field.name);
      if (field.range == Range::nonnegative && value < 0) {
        in.fail(std::string(field.name) + " is " + std::to_string(value) +
                ", but must not be negative");
      }
    }
  });
  // now the file is known to hold as many numbers as its sizes say
  for (auto& [member, read] : matrices) {
    problem.*member = read.blocks ? converted(read.matrix, Storage::csr) : std::move(read.matrix);
  }
  return problem;
}

Problem parse(Reader& in, std::string_view kind) {
  const std::optional<Layout> wanted = layout_of(kind);
  std::vector<Index> dimensions;
  for (const Layout& layout : wanted ? std::vector{*wanted} : layouts()) {
    dimensions.insert(dimensions.end(), layout.dimensions.begin(), layout.dimensions.end());
  }
  std::sort(dimensions.begin(), dimensions.end());
  dimensions.erase(std::unique(dimensions.begin(), dimensions.end()), dimensions.end());
  const Index d = in.integer("the dimension", 0, largest_index);
  if (std::find(dimensions.begin(), dimensions.end(), d) == dimensions.end()) {
    std::string known;
    for (const Index one : dimensions) known += (known.empty() ? "" : ", ") + std::to_string(one);
    in.fail("the dimension is " + std::to_string(d) + ", but must be one of " + known);
  }
  const Index nc = in.integer("the number of contacts", 0, largest_index / d);
  in.require_room(nc, 2, "mu");
  ReadMatrix first = read_matrix(in, "the first matrix", -1, -1);
  const Layout layout = wanted ? *wanted : detect(in, d, nc, first);

  Problem problem;
  for_each_formulation([&]<class P>(std::type_identity<P>) {
    if (layout.kind == P::kind) problem = read_fields<P>(in, d, nc, std::move(first));
  });
  if (!in.at_end()) {
    const std::string_view word = in.token("");
    if (!is_flag(word) || !in.at_end()) {
      in.fail(quoted(word) + " follows what a " + std::string(layout.kind) +
              " problem of these sizes has");
    }
  }
  return problem;
}

// ---- writing ----------------------------------------------------------------------------------

/// Puts together a text.
class Writer {
 public:
  Writer& operator<<(std::string_view text) {
    text_ += text;
    return *this;
  }
  Writer& operator<<(Index value) { return put(value); }
  /// As few digits as it takes to read the number back equal.
  Writer& operator<<(double value) { return put(value); }

  void line(const double* values, std::size_t size) {
    for (std::size_t k = 0; k < size; ++k) *this << (k > 0 ? " " : "") << values[k];
    *this << "\n";
  }

  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  template <class Number>
  Writer& put(Number value) {
    char digits[32];
    const auto end = std::to_chars(std::begin(digits), std::end(digits), value).ptr;
    text_.append(std::begin(digits), end);
    return *this;
  }
  std::string text_;
};

/// Sorted and without duplicates, in a sparse storage.
Matrix canonical(const Matrix& a, Storage storage) {
  if (storage == Storage::triplet) {
    const SparseColumns sum = to_eigen(a);
    const bool unique = static_cast<std::size_t>(sum.nonZeros()) == a.nnz();
    return unique ? a : converted(Matrix::from_eigen(sum), storage);
  }
  Matrix result = converted(a, storage);
  return is_canonical(result) ? result : converted(Matrix::from_eigen(to_eigen(a)), storage);
}

void write_dense(Writer& out, const Matrix& a) {
  out << a.rows << "\t" << a.cols << "\n";
  const auto rows = static_cast<std::size_t>(a.rows);
  for (std::size_t start = 0; start < a.x.size(); start += rows) out.line(&a.x[start], rows);
}

/// A square matrix by rows, in blocks of d x d.
void write_blocks(Writer& out, const Matrix& a, Index d) {
  const Index count = a.rows / d;
  const auto entries = static_cast<std::size_t>(d) * static_cast<std::size_t>(d);
  std::vector<Index> pointers{0};
  std::vector<Index> block_cols;
  std::vector<double> blocks;
  std::vector<Index> place(static_cast<std::size_t>(count), -1);  // of a block in its row
  for (Index row = 0; row < count; ++row) {
    const auto first = block_cols.size();
    const Index begin = a.p[static_cast<std::size_t>(row * d)];
    const Index end = a.p[static_cast<std::size_t>(row * d + d)];
    block_cols.push_back(row);
    for (Index k = begin; k < end; ++k) {
      block_cols.push_back(a.i[static_cast<std::size_t>(k)] / d);
    }
    const auto start = block_cols.begin() + static_cast<std::ptrdiff_t>(first);
    std::sort(start, block_cols.end());
    block_cols.erase(std::unique(start, block_cols.end()), block_cols.end());
    for (std::size_t k = first; k < block_cols.size(); ++k) {
      place[static_cast<std::size_t>(block_cols[k])] = static_cast<Index>(k);
    }
    blocks.resize(block_cols.size() * entries, 0.0);
    for (Index i = row * d; i < row * d + d; ++i) {
      for (Index k = a.p[static_cast<std::size_t>(i)]; k < a.p[static_cast<std::size_t>(i) + 1];
           ++k) {
        const Index col = a.i[static_cast<std::size_t>(k)];
        const auto block = static_cast<std::size_t>(place[static_cast<std::size_t>(col / d)]);
        const Index within = (col % d) * d + i % d;
        blocks[block * entries + static_cast<std::size_t>(within)] =
            a.x[static_cast<std::size_t>(k)];
      }
    }
    pointers.push_back(static_cast<Index>(block_cols.size()));
  }

  out << static_cast<Index>(block_cols.size()) << "\n" << count << "\n" << count << "\n";
  for (int side = 0; side < 2; ++side) {
    for (Index k = 1; k <= count; ++k) out << k * d << "\t";
    out << "\n";
  }
  out << count + 1 << "\n" << static_cast<Index>(block_cols.size()) << "\n";
  for (const auto* list : {&pointers, &block_cols}) {
    for (const Index value : *list) out << value << "\t";
    out << "\n";
  }
  for (std::size_t k = 0; k < block_cols.size(); ++k) {
    out << static_cast<Index>(k) << "\n";
    out.line(&blocks[k * entries], entries);
  }
}

void write_sparse(Writer& out, const Matrix& a) {
  const bool triplet = a.storage == Storage::triplet;
  const auto nnz = static_cast<Index>(a.nnz());
  out << static_cast<Index>(triplet ? origin_triplet : origin_csc) << "\n";
  out << "CSparse's text, by fclib " << version << "\n";
  out << (triplet ? "triplet: " : "") << a.rows << "-by-" << a.cols << ", nzmax: " << nnz
      << " nnz: " << nnz << "\n";
  if (triplet) {
    for (std::size_t k = 0; k < a.nnz(); ++k) {
      out << "    " << a.i[k] << " " << a.p[k] << " : " << a.x[k] << "\n";
    }
    return;
  }
  for (Index col = 0; col < a.cols; ++col) {
    const auto begin = static_cast<std::size_t>(a.p[static_cast<std::size_t>(col)]);
    const auto end = static_cast<std::size_t>(a.p[static_cast<std::size_t>(col) + 1]);
    out << "    col " << col << " : locations " << static_cast<Index>(begin) << " to "
        << static_cast<Index>(end) - 1 << "\n";
    for (std::size_t k = begin; k < end; ++k) out << "      " << a.i[k] << " : " << a.x[k] << "\n";
  }
}

/// `block` is the size of a contact where both sides are those of the contacts, 0 elsewhere.
void write_matrix(Writer& out, const Matrix& a, Index block) {
  const bool blocks = a.storage == Storage::csr && block > 0 && a.rows > 0;
  const bool dense = a.storage == Storage::dense;
  out << static_cast<Index>(dense    ? text_dense
                            : blocks ? text_blocks
                                     : text_sparse)
      << "\n"
      << a.rows << "\n"
      << a.cols << "\n";
  if (dense) {
    write_dense(out, a);
  } else if (blocks) {
    write_blocks(out, canonical(a, Storage::csr), block);
  } else {
    const bool triplet = a.storage == Storage::triplet;
    write_sparse(out, canonical(a, triplet ? Storage::triplet : Storage::csc));
  }
}

template <class P>
std::string text_of(const P& problem) {
  Writer out;
  out << problem.spacedim << "\n" << problem.size(Dim::nc) << "\n";
  for_each_stored<P, Matrix>([&](const auto& field) {
    const bool contacts = field.rows == Dim::m && field.cols == Dim::m;
    write_matrix(out, problem.*field.member, contacts ? problem.spacedim : 0);
  });
  for_each_stored<P, Vector>([&](const auto& field) {
    const Vector& values = problem.*field.member;
    out.line(values.data(), static_cast<std::size_t>(values.size()));
  });
  return out.text();
}

}  // namespace

Problem read_siconos(const std::string& path, std::string_view kind) {
  const std::string text = read_file(path);
  try {
    if (text.starts_with("\x89HDF")) {
      throw Error(ErrorKind::file, "is an HDF5 file, not a text of Siconos");
    }
    Reader in(text);
    Problem problem = parse(in, kind);
    std::visit(
        [&](auto& p) {
          validate(p);
          p.info.title = std::filesystem::path(path).stem().string();
        },
        problem);
    return problem;
  } catch (const Error& error) {
    throw error.in_file(path);
  }
}

void write_siconos(const std::string& path, ProblemPointer problem) {
  try {
    std::visit(
        [&]<class P>(const P* p) {
          validate(*p);
          if (is_mixed(*p)) {
            throw Error(ErrorKind::unsuitable,
                        "the problem has bilateral constraints, for which Siconos' text has no "
                        "place; eliminate them first");
          }
          replace_file(path, text_of(*p));
        },
        problem);
  } catch (const Error& error) {
    throw error.in_file(path);
  }
}

}  // namespace fclib
