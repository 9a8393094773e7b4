// Any bytes as a text of Siconos.
#include "io/siconos/siconos.hpp"

#include "fuzz.hpp"
#include "io/replace_file.hpp"
#include "small_problems.hpp"

namespace fclib::fuzz {

namespace {

void write(const std::string& path, const Problem& problem) {
  std::visit([&](const auto& p) { write_siconos(path, &p); }, problem);
}

/// A valid problem is written, and what is written is read: the same text, once the duplicates are
/// added up and the blocks are filled.
void require_same_again(const Problem& problem, std::string_view kind) {
  static const std::string copy = (scratch() / "copy.dat").string();
  write(copy, problem);
  const std::string first = read_file(copy);
  write(copy, read_siconos(copy, kind));
  require(read_file(copy) == first, "a text that was written is read and written alike");
}

void run(std::string_view bytes) {
  static const std::string path = (scratch() / "problem.dat").string();
  put_file(path, bytes);
  std::vector<std::string_view> kinds{""};
  for_each_formulation([&]<class P>(std::type_identity<P>) { kinds.push_back(P::kind); });
  for (const auto kind : kinds) {
    Problem problem;
    if (!accepted(path, [&] { problem = read_siconos(path, kind); })) continue;
    std::visit([](const auto& p) { validate(p); }, problem);
    const auto kind_of = []<class P>(const P&) { return P::kind; };
    require_same_again(problem, std::visit(kind_of, problem));
  }
}

std::vector<Input> seeds() {
  std::vector<Input> result;
  static const std::string path = (scratch() / "seed.dat").string();
  for_each_small_problem([&]<class P>(const std::string& name, const P& problem) {
    if (P::spin || is_mixed(problem)) return;  // for which the text has no place
    write_siconos(path, &problem);
    const std::string text = read_file(path);
    result.push_back({name, text});
    result.push_back({name + "-flag", text + "0\n"});
    // what is symmetric reads the same by rows
    const std::string by_columns = "\n2\nCSparse";
    const std::size_t at = text.find(by_columns);
    if (at == text.npos) return;
    std::string by_rows = text;
    by_rows.replace(at, by_columns.size(), "\n3\nCSparse");
    result.push_back({name + "-rows", by_rows});
  });
  return result;
}

}  // namespace

const Target siconos_text{.name = "siconos_text", .run = run, .seeds = seeds};

}  // namespace fclib::fuzz
