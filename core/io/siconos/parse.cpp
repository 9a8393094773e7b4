#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "io/siconos/layout.hpp"
#include "io/siconos/siconos.hpp"
#include "io/siconos/words.hpp"

namespace fclib {

using namespace siconos;

namespace {

void read_numbers(Words& in, Count count, What what, std::vector<double>& values) {
  in.require_room(count, 2, what);
  // if each of many blocks reserved exactly, it would copy all the earlier ones each time
  if (values.empty()) values.reserve(static_cast<std::size_t>(count));
  for (Count k = 0; k < count; ++k) values.push_back(in.number(what));
}

Matrix empty_matrix(Storage storage, Index rows, Index cols) {
  return {.storage = storage, .rows = rows, .cols = cols, .p = {}, .i = {}, .x = {}, .info = {}};
}

Matrix read_dense(Words& in, Index rows, Index cols, What what) {
  Matrix a = empty_matrix(Storage::dense, rows, cols);
  const Index again[2] = {in.integer(what, 0, largest_index), in.integer(what, 0, largest_index)};
  if (again[0] != rows || again[1] != cols) {
    in.fail(std::string(what) + " is " + std::to_string(rows) + " x " + std::to_string(cols) +
            ", and " + std::to_string(again[0]) + " x " + std::to_string(again[1]));
  }
  read_numbers(in, static_cast<Count>(rows) * cols, what, a.x);
  return a;
}

/// The start of each block of one side: 0, then the cumulated sizes of the file.
std::vector<Index> read_block_starts(Words& in, Index blocks, Index size, What what) {
  in.require_room(blocks, 2, what);
  std::vector<Index> starts{0};
  for (Index k = 0; k < blocks; ++k) starts.push_back(in.integer(what, starts.back(), size));
  if (starts.back() != size) {
    in.fail("the blocks of " + std::string(what) + " add up to " + std::to_string(starts.back()) +
            ", not to its size " + std::to_string(size));
  }
  return starts;
}

Matrix read_blocks(Words& in, Index rows, Index cols, What what) {
  const Index count = in.integer(what, 0, largest_index);
  const Index block_rows = in.integer(what, 0, rows);
  const Index block_cols = in.integer(what, 0, cols);
  const std::vector<Index> row_starts = read_block_starts(in, block_rows, rows, what);
  const std::vector<Index> col_starts = read_block_starts(in, block_cols, cols, what);

  // rows of blocks after the last non-empty one have no pointer
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

  Matrix a = empty_matrix(Storage::triplet, rows, cols);
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

SparseHeader read_sparse_header(Words& in, Index rows, Index cols, What what) {
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

Matrix read_sparse(Words& in, Index rows, Index cols, What what) {
  const Index origin = in.integer("the origin of " + std::string(what), origin_triplet, origin_csr);
  in.rest_of_line();
  in.rest_of_line();  // the version of CSparse
  const SparseHeader header = read_sparse_header(in, rows, cols, what);
  if (header.triplet != (origin == origin_triplet)) {
    in.fail(std::string(what) + " is of origin " + std::to_string(origin) + ", but " +
            (header.triplet ? "" : "not ") + "a list of triplets");
  }
  Matrix a = empty_matrix(Storage::triplet, rows, cols);
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

  // if it is by rows, "col" numbers a row
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

/// A matrix. `rows` and `cols` are its expected sizes, or -1. Blocks become triplets.
struct ReadMatrix {
  Matrix matrix;
  bool blocks = false;
  Count line = 1;  // the line of its sizes
};

ReadMatrix read_matrix(Words& in, What what, Index expected_rows, Index expected_cols) {
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
  // a vector of each of these lengths follows, so a file cannot announce more than it has room for
  in.require_room(rows, 2, what);
  in.require_room(cols, 2, what);
  ReadMatrix result{.matrix = {}, .blocks = storage == text_blocks, .line = line};
  if (storage == text_dense) result.matrix = read_dense(in, rows, cols, what);
  if (storage == text_blocks) result.matrix = read_blocks(in, rows, cols, what);
  if (storage == text_sparse) result.matrix = read_sparse(in, rows, cols, what);
  return result;
}

/// Whether a matrix may start here: three integers, the first of which is a storage.
bool may_be_matrix(Words in) {
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

/// What kinds a text may be, judged by its first matrix. If d = 3 does not tell whether it rolls,
/// also how many words follow the part that both kinds have.
Layout detect(const Words& in, Index d, Index nc, const ReadMatrix& first) {
  const Count m = Count{d} * nc;
  const Matrix& a = first.matrix;
  const bool fits = a.rows == m && a.cols == m;
  // the vectors of a local problem, at most two coefficients for each contact, and the flag
  const Count longest_local = m + 2 * Count{nc} + 1;
  const bool global =
      may_be_matrix(in) && (!fits || in.words_left(longest_local + 1) > longest_local);
  if (!global && !fits) {
    Words::fail_at(first.line, "the first matrix is " + std::to_string(a.rows) + " x " +
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
  Words ahead = in;
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
P read_fields(Words& in, Index d, Index nc, ReadMatrix first) {
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
        Words::fail_at(first.line, std::string(field.name) + " is " +
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
  // from here on the file is known to hold as many numbers as its sizes say
  for (auto& [member, read] : matrices) {
    problem.*member = read.blocks ? converted(read.matrix, Storage::csr) : std::move(read.matrix);
  }
  return problem;
}

Problem parse(Words& in, std::string_view kind) {
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

}  // namespace

Problem parse_siconos(std::string_view text, std::string_view kind) {
  if (text.starts_with("\x89HDF")) {
    throw Error(ErrorKind::file, "is an HDF5 file, not a text of Siconos");
  }
  Words in(text);
  Problem problem = parse(in, kind);
  std::visit([](const auto& p) { validate(p); }, problem);
  return problem;
}

}  // namespace fclib
