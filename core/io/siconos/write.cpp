#include <algorithm>
#include <vector>

#include "io/replace_file.hpp"
#include "io/siconos/layout.hpp"
#include "io/siconos/siconos.hpp"
#include "number_text.hpp"
#include "version.hpp"

namespace fclib {

using namespace siconos;

namespace {

/// Builds a text.
class Writer {
 public:
  Writer& operator<<(std::string_view text) {
    text_ += text;
    return *this;
  }
  Writer& operator<<(Index value) { return *this << std::to_string(value); }
  /// The fewest digits that read back as the same number.
  Writer& operator<<(double value) { return *this << shortest(value); }

  void line(const double* values, std::size_t size) {
    for (std::size_t k = 0; k < size; ++k) *this << (k > 0 ? " " : "") << values[k];
    *this << "\n";
  }

  [[nodiscard]] const std::string& text() const { return text_; }

 private:
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
  std::vector<Index> place(static_cast<std::size_t>(count), -1);  // place of a block in its row
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

/// `block` is the size of a contact if both sides are those of the contacts, else 0.
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

void write_siconos(const std::string& path, ProblemPointer problem) {
  try {
    std::visit(
        [&]<class P>(const P* p) {
          validate(*p);
          if (P::spin) {
            throw Error(ErrorKind::unsuitable,
                        "the problem has spin friction, for which Siconos' text has no place");
          }
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
