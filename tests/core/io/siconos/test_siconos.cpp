#include "io/siconos/siconos.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>

#include "convert/storage.hpp"
#include "io/replace_file.hpp"
#include "random_data.hpp"
#include "temporary_folder.hpp"

namespace fclib {
namespace {

namespace fs = std::filesystem;
using testing::RandomData;

/// A file in a folder of its own.
class SiconosText : public ::testing::Test {
 protected:
  [[nodiscard]] std::string path() const { return (folder_.path() / "problem.dat").string(); }

  [[nodiscard]] Problem read(const std::string& text, std::string_view kind = {}) const {
    std::ofstream(path(), std::ios::binary) << text;
    return read_siconos(path(), kind);
  }
  template <class P>
  [[nodiscard]] P there_and_back(const P& problem) const {
    write_siconos(path(), &problem);
    return std::get<P>(read_siconos(path()));
  }
  /// The message of the error, the file's name taken off.
  [[nodiscard]] std::string message_of(const std::string& text, std::string_view kind = {}) const {
    try {
      static_cast<void>(read(text, kind));
    } catch (const Error& error) {
      const std::string message = error.what();
      EXPECT_TRUE(message.starts_with(path() + ": ")) << message;
      EXPECT_EQ(message.find('\n'), std::string::npos);
      return message.substr(path().size() + 2);
    }
    return "no error";
  }

 private:
  testing::TemporaryFolder folder_;
};

template <class P>
P random_problem(std::uint64_t seed, Index d, Index nc) {
  RandomData random(seed);
  P problem;
  problem.spacedim = d;
  const Index m = d * nc;
  const Index n = m + 5;
  const auto sparse = [&](Index rows, Index cols) {
    return Matrix::from_eigen(random.sparse(rows, cols, 0.3));
  };
  for_each_field<P>([&]<class Member>(const Field<P, Member>& field) {
    if (field.presence != Presence::required) return;
    const auto length = [&](Dim dim) { return dim == Dim::n ? n : dim == Dim::m ? m : nc; };
    if constexpr (std::same_as<Member, Matrix>) {
      problem.*field.member = sparse(length(field.rows), length(field.cols));
    } else if constexpr (std::same_as<Member, Vector>) {
      const Vector values = random.vector(length(field.rows));
      problem.*field.member =
          field.range == Range::nonnegative ? Vector(values.cwiseAbs()) : values;
    }
  });
  return problem;
}

TEST_F(SiconosText, KeepsEveryFormulationInEveryStorage) {
  for_each_formulation([&]<class P>(std::type_identity<P>) {
    if (P::spin) return;  // the text has no place for it
    for (const Index d : P::dimensions) {
      for (const Index nc : {0, 1, 2, 7}) {
        // without contacts there is nothing that rolls
        if (P::rolling && nc == 0 && d == 3) continue;
        const P problem = random_problem<P>(static_cast<std::uint64_t>(10 * d + nc), d, nc);
        for (const auto storage : {Storage::csr, Storage::csc, Storage::triplet, Storage::dense}) {
          SCOPED_TRACE(formulation(problem) + " " + std::to_string(nc) + " " +
                       std::string(name_of(storage)));
          const P given = with_storage(problem, storage);
          const P found = there_and_back(given);
          EXPECT_EQ(found.spacedim, d);
          EXPECT_EQ(found.info.title, "problem");
          for_each_field<P>([&]<class Member>(const Field<P, Member>& field) {
            if constexpr (std::same_as<Member, Matrix>) {
              const Matrix& a = given.*field.member;
              const Matrix& b = found.*field.member;
              if (storage != Storage::csr) {
                EXPECT_EQ(a, b) << field.name;
              } else if (!a.empty()) {
                // blocks have zeros that the rows had not, and columns are no rows
                EXPECT_EQ(converted(a, Storage::dense), converted(b, Storage::dense)) << field.name;
              }
            } else if constexpr (std::same_as<Member, Vector>) {
              EXPECT_EQ(given.*field.member, found.*field.member) << field.name;
            }
          });
        }
      }
    }
  });
}

TEST_F(SiconosText, KeepsEveryBitOfANumber) {
  LocalProblem problem = random_problem<LocalProblem>(1, 3, 3);
  using Limits = std::numeric_limits<double>;
  problem.q << 0.1, 1.0 / 3, -0.0, Limits::max(), Limits::lowest(), Limits::min(),
      Limits::denorm_min(), 1 + Limits::epsilon(), 1e22;
  const LocalProblem found = there_and_back(problem);
  for (Eigen::Index k = 0; k < problem.q.size(); ++k) {
    EXPECT_EQ(problem.q[k], found.q[k]);
    EXPECT_EQ(std::signbit(problem.q[k]), std::signbit(found.q[k]));
  }
}

TEST_F(SiconosText, AddsDuplicatesUp) {
  LocalProblem problem = random_problem<LocalProblem>(1, 2, 1);
  problem.W = {.storage = Storage::triplet,
               .rows = 2,
               .cols = 2,
               .p = {1, 0, 1},
               .i = {0, 1, 0},
               .x = {1, 2, 4},
               .info = {}};
  const auto expected = converted(problem.W, Storage::dense);
  for (const auto storage : {Storage::triplet, Storage::csc, Storage::csr}) {
    const LocalProblem found = there_and_back(with_storage(problem, storage));
    EXPECT_EQ(converted(found.W, Storage::dense), expected);
    if (storage == Storage::triplet) {
      EXPECT_EQ(found.W.nnz(), 2U);
    }
  }
}

TEST_F(SiconosText, WritesTheBlocksOfTheDiagonal) {
  LocalProblem problem = random_problem<LocalProblem>(1, 2, 2);
  problem.W = {.storage = Storage::csr,
               .rows = 4,
               .cols = 4,
               .p = {0, 1, 1, 1, 1},
               .i = {3},
               .x = {7},
               .info = {}};
  EXPECT_EQ(there_and_back(problem).W.nnz(), 12U);
}

TEST_F(SiconosText, RefusesBilateralConstraints) {
  LocalProblem problem = random_problem<LocalProblem>(1, 3, 2);
  problem.V = converted(Matrix::from_eigen(SparseColumns(6, 1)), Storage::csr);
  problem.R = converted(Matrix::from_eigen(SparseColumns(1, 1)), Storage::csr);
  problem.s = Vector::Zero(1);
  EXPECT_THROW(write_siconos(path(), &problem), Error);
  EXPECT_FALSE(fs::exists(path()));
}

// ---- texts of others

const char* const one_contact = "3\n1\n0\n3\n3\n3\t3\n1 0 0\n0 1 0\n0 0 1\n-1 0 0\n0.5\n";

TEST_F(SiconosText, TellsFormulationsFromTheSizes) {
  const std::string sparse_m =
      "2\n3\n3\n1\nCSparse\ntriplet: 3-by-3, nzmax: 3 nnz: 3\n0 0 : 1\n1 1 : 1\n2 2 : 1\n";
  const std::string dense = "0 3 3 3 3 1 0 0 0 1 0 0 0 1\n";
  const auto kind_of = [&](const std::string& text) {
    return std::visit([]<class P>(const P&) { return std::string(P::kind); }, read(text));
  };
  EXPECT_EQ(kind_of(one_contact), "local");
  EXPECT_EQ(kind_of(one_contact + std::string("1\n")), "local");  // the flag of old files
  EXPECT_EQ(kind_of(one_contact + std::string("1e-3\n")), "local_rolling");
  EXPECT_EQ(kind_of(one_contact + std::string("1e-3\n0\n")), "local_rolling");
  EXPECT_EQ(kind_of("3 1 " + dense + "0 3 3  0.5"), "local");  // q looks like the start of a matrix
  EXPECT_EQ(kind_of("3 1 " + dense + dense + "1 2 3  4 5 6  0.5"), "global");
  EXPECT_EQ(kind_of("3 1 " + sparse_m + sparse_m + "1 2 3  4 5 6  0.5 0"), "global");
  EXPECT_EQ(kind_of("3 1 " + sparse_m + dense + "1 2 3  4 5 6  0.5 0.1"), "global_rolling");
  EXPECT_EQ(kind_of("3 0 0 0 0 0 0"), "local");
  EXPECT_EQ(kind_of("3 0 " + dense + "2 3 0 2\nversion\n3-by-0, nzmax: 0 nnz: 0, 1-norm: 0\n1 2 3"),
            "global");
  EXPECT_TRUE(std::holds_alternative<LocalRollingProblem>(
      read(one_contact + std::string("1\n"), "local_rolling")));
}

TEST_F(SiconosText, ReadsRowsAsRows) {
  const auto problem =
      std::get<LocalProblem>(read("2 1 2 2 2 3\nCSparse\n2-by-2, nzmax: 2 nnz: 2, 1-norm: -1\n"
                                  "    col 0 : locations 0 to 1\n      0 : 1\n      1 : 5\n"
                                  "    col 1 : locations 2 to 1\n 0 0 0.3\n"));
  EXPECT_EQ(problem.W.storage, Storage::csr);
  EXPECT_EQ(converted(problem.W, Storage::dense).x, (std::vector<double>{1, 0, 5, 0}));
}

TEST_F(SiconosText, ReadsBlocksOfAnySize) {
  // 1 x 2 above 2 x 1
  const auto problem = std::get<LocalProblem>(
      read("3 1  1 3 3  2 2 2  1 3  2 3  3 2  0 1 2  0 1  0 9 8  1 1 2  0 0 0  0.3"));
  EXPECT_EQ(problem.W.storage, Storage::csr);
  EXPECT_EQ(problem.W.p, (std::vector<Index>{0, 2, 3, 4}));
  EXPECT_EQ(problem.W.i, (std::vector<Index>{0, 1, 2, 2}));
  EXPECT_EQ(problem.W.x, (std::vector<double>{9, 8, 1, 2}));
}

TEST_F(SiconosText, NamesTheLine) {
  const auto expect = [&](const std::string& text, const std::string& start,
                          std::string_view kind = {}) {
    EXPECT_EQ(message_of(text, kind).substr(0, start.size()), start) << text;
  };
  expect("", "line 1: the file ends inside the dimension");
  expect("\n\nx", "line 3: 'x' is not an integer (the dimension)");
  expect("4 1", "line 1: the dimension is 4, but must be one of 2, 3, 5");
  expect("5 1", "line 1: the dimension is 5, but must be one of 2, 3", "local");
  expect("3\n-1", "line 2: the number of contacts is -1, but must be in 0..");
  expect("3\n99999999999999999999", "line 2: the number of contacts is 99999999999999999999");
  expect("3\n700000000", "line 2: mu has 700000000 entries by its sizes, but the file ends before");
  expect("3\n1\n7", "line 3: the storage of the first matrix is 7");
  expect("3\n1\n0\n3\n3\n3 4\n", "line 6: the first matrix is 3 x 3, and 3 x 4");
  expect("3\n1\n0\n2000000000\n3\n", "line 5: the first matrix has 2000000000 entries");
  expect("3\n1\n0\n3\n3\n3 3\n1 0 0\n0 one 0\n",
         "line 8: 'one' is not a number (the first matrix)");
  expect("3\n1\n0\n3\n3\n3 3\n1 0 0\n0 nan 0\n", "line 8: 'nan' is not a finite number");
  expect("3\n1\n0\n3\n3\n3 3\n1 0 0\n0 1e999 0\n", "line 8: '1e999' is not a finite number");
  expect("3 2\n0 3 3 3 3 1 0 0 0 1 0 0 0 1\n-1 0 0\n", "line 2: the first matrix is 3 x 3, but 2");
  expect("3 1\n0 3 3 3 3 1 0 0 0 1 0 0 0 1\n-1 0 0\n-0.5", "line 4: mu is -0.5");
  expect("3 1\n0 3 3 3 3 1 0 0 0 1 0 0 0 1\n-1 0 0\n", "line 4: the file ends inside mu");
  expect(std::string(one_contact) + "1 2\n3", "line 12: '1' follows what a local problem");
  expect(one_contact, "line 12: the file ends inside mu_r", "local_rolling");
  expect(one_contact, "line 10: the storage of H is -1", "global");
  expect("\x89HDF\r\n\x1a\n", "is an HDF5 file");
  expect(one_contact, "kind: there is no kind 'mixed'; there are: ", "mixed");
}

TEST_F(SiconosText, ChecksWhatItReads) {
  const std::string sparse = "3\n1\n2\n3\n3\n2\nCSparse\n";
  const auto refused = [&](const std::string& text) {
    const std::string message = message_of(text);
    EXPECT_TRUE(message.starts_with("line ")) << text << message;
  };
  refused(sparse);
  refused(sparse + "4-by-3, nzmax: 1 nnz: 1\n");
  refused(sparse + "3-by-3, nzmax: 1 nnz: 2\n");
  refused(sparse + "3-by-3, nzmax: 2000000000 nnz: 2000000000\n");
  refused(sparse + "3-by-3, nzmax: -1 nnz: -1\n");
  refused(sparse + "triplet: 3-by-3, nzmax: 1 nnz: 1\n 0 0 : 1\n");
  refused(sparse + "(null)\n");
  const std::string columns = sparse + "3-by-3, nzmax: 1 nnz: 1\n";
  refused(columns + "col 0 : locations 0 to 2000000000\n");
  refused(columns + "col 0 : locations 0 to -5\n");
  refused(columns + "col 1 : locations 0 to 0\n");
  refused(columns + "col 0 : locations 1 to 1\n");
  refused(columns + "col 0 : locations 0 to 0\n 3 : 1\n");
  refused(columns + "col 0 : locations 0 to 0\n -1 : 1\n");
  refused(columns + "col 0 : locations 0 to 0\n 0 1\n");
  refused(columns + "col 0 : locations 0 to 0\n 0 : 1\ncol 1 : locations 1 to 0\n");
  const std::string blocks = "3 1 1 3 3  ";
  refused(blocks + "1 1 1  3  3  2 1  0 1  0  1  1 2 3 4 5 6 7 8 9");    // another number
  refused(blocks + "1 1 1  3  3  2 1  0 1  1  0  1 2 3 4 5 6 7 8 9");    // column
  refused(blocks + "1 1 1  3  3  2 2  0 1  0 0  0  1 2 3 4 5 6 7 8 9");  // listed
  refused(blocks + "2 1 1  3  3  2 2  0 1  0 0  0  1 2 3 4 5 6 7 8 9");  // pointers
  refused(blocks + "1 1 1  2  3  2 1  0 1  0  0  1 2 3 4 5 6 7 8 9");    // sizes
  refused(blocks + "1 1 1  4  3  2 1  0 1  0  0  1 2 3 4 5 6 7 8 9");
  refused(blocks + "1 2 1  3 1  3  2 1  0 1  0  0  1 2 3 4 5 6 7 8 9");
  refused(blocks + "1 1 1  3  3  9 1  0 1  0  0  1 2 3 4 5 6 7 8 9");
  refused(blocks + "1 1 1  3  3  2 1  1 1  0  0  1 2 3 4 5 6 7 8 9");
  refused(blocks + "2000000000 1 1  3  3  2 2000000000  0 2000000000  0");
}

TEST_F(SiconosText, SurvivesWhatIsSpoilt) {
  RandomData random(5);
  const auto at = [&](std::size_t size) {
    return static_cast<std::size_t>(random.uniform(0, static_cast<double>(size)));
  };
  const std::string alphabet = "0123456789-+.eE:, \n\tnaif";
  int refused = 0;
  for_each_formulation([&]<class P>(std::type_identity<P>) {
    if (P::spin) return;  // the text has no place for it
    for (const auto storage : {Storage::csr, Storage::csc, Storage::triplet, Storage::dense}) {
      const P problem = with_storage(random_problem<P>(3, P::dimensions[0], 3), storage);
      write_siconos(path(), &problem);
      const std::string good = read_file(path());
      for (int k = 0; k < 100; ++k) {
        std::string text = good;
        const std::size_t changes = 1 + at(4);
        for (std::size_t change = 0; change < changes; ++change) {
          const std::size_t place = at(k % 2 == 0 ? 60 : text.size());
          if (k % 3 == 0) {
            text.insert(place, 1, alphabet[at(alphabet.size())]);
          } else if (k % 3 == 1) {
            text.erase(place, 1 + at(5));
          } else {
            text[place] = alphabet[at(alphabet.size())];
          }
        }
        if (k % 10 == 0) text.resize(at(text.size()));
        refused += message_of(text) != "no error";
      }
    }
  });
  EXPECT_GT(refused, 700);
}

// ---- files

TEST_F(SiconosText, RefusesWhatIsNoFile) {
  EXPECT_THROW(read_siconos(path()), Error);
  EXPECT_THROW(read_siconos(fs::path(path()).parent_path().string()), Error);
  const LocalProblem problem = random_problem<LocalProblem>(1, 3, 1);
  EXPECT_THROW(write_siconos(fs::path(path()).parent_path().string(), &problem), Error);
  EXPECT_THROW(write_siconos(path() + "/problem.dat", &problem), Error);
}

TEST_F(SiconosText, LeavesTheOldFileWhereItFails) {
  const LocalProblem good = random_problem<LocalProblem>(1, 3, 1);
  write_siconos(path(), &good);
  const std::string before = read_file(path());
  LocalProblem bad = good;
  bad.q[0] = std::nan("");
  EXPECT_THROW(write_siconos(path(), &bad), Error);
  EXPECT_EQ(read_file(path()), before);
  EXPECT_EQ(std::distance(fs::directory_iterator(fs::path(path()).parent_path()), {}), 1);
}

}  // namespace
}  // namespace fclib
