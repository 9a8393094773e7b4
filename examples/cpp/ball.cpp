// Builds a problem, writes it, reads it, solves it and judges the solution: ball FILE [SOLVER].
//
// The C interface with C++'s manners: what is read frees itself, and what fails throws.
#include <fclib.h>

#include <array>
#include <cstdlib>
#include <iostream>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

/// Frees what fclib_read_local() returns: the members, then the struct.
struct DeleteLocal {
  void operator()(fclib_local* problem) const {
    fclib_delete_local(problem);
    std::free(problem);
  }
};
using Local = std::unique_ptr<fclib_local, DeleteLocal>;

/// Throws with the library's message where a call of it failed.
void require(bool well, const std::string& what) {
  if (!well) throw std::runtime_error(what + ": " + fclib_last_error());
}

Local read(const std::string& path) {
  Local problem(fclib_read_local(path.c_str()));
  require(problem != nullptr, "reading");
  return problem;
}

/// A solution that owns its arrays, and the struct that lets the library see them.
struct Solution {
  explicit Solution(const fclib_local& problem)
      : u(length(problem.W)), r(length(problem.W)), l(length(problem.R)) {}

  [[nodiscard]] fclib_solution view() { return {nullptr, u.data(), r.data(), l.data()}; }

  std::vector<double> u, r, l;

 private:
  static std::size_t length(const fclib_matrix* a) {
    return a != nullptr ? static_cast<std::size_t>(a->m) : 0;
  }
};

/// A ball of 1 kg falls on a plane while it slides.
void write_ball(const std::string& path) {
  // u = W r + q with W = 1 / mass, dense
  std::array<double, 9> inverse_mass{1, 0, 0, 0, 1, 0, 0, 0, 1};
  std::array<double, 3> q{-1, 2, 0};
  std::array<double, 1> mu{0.5};
  std::string title = "a ball on a plane";
  fclib_info info{title.data(), nullptr, nullptr};
  fclib_matrix W{9, 3, 3, nullptr, nullptr, inverse_mass.data(), -3, nullptr};
  fclib_local problem{};
  problem.W = &W;
  problem.q = q.data();
  problem.mu = mu.data();
  problem.spacedim = 3;
  problem.info = &info;
  require(fclib_validate_local(&problem), "the problem");
  require(fclib_write_local(&problem, path.c_str()), "writing");
}

void run(const std::string& path, const std::string& solver) {
  require(fclib_set_write_mode(FCLIB_WRITE_REPLACE), "the mode");
  write_ball(path);

  const Local problem = read(path);
  Solution solution(*problem);
  fclib_solution view = solution.view();
  fclib_solve_options options{};
  options.tolerance = 1e-10;
  fclib_solve_result result{};
  require(fclib_solve_local(problem.get(), solver.c_str(), &options, &view, &result), "solving");
  std::cout << problem->info->title << ": " << fclib_status_name(result.status) << " after "
            << result.iterations << " iterations\nr =";
  for (const double component : solution.r) std::cout << ' ' << component;
  std::cout << "\nmerit " << fclib_merit_local(problem.get(), MERIT_2, &view) << '\n';
  require(fclib_write_solution(&view, path.c_str()), "writing");
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::cerr << "usage: " << argv[0] << " FILE [SOLVER]\n";
    return 2;
  }
  fclib_set_error_handler(nullptr, nullptr);  // what fails is thrown, and told once
  try {
    run(argv[1], argc > 2 ? argv[2] : fclib_solver_name(0));
  } catch (const std::exception& error) {
    std::cerr << error.what() << '\n';
    return 1;
  }
}
