// Builds a problem, writes it, reads it, solves it and judges the solution: ball FILE [SOLVER].
//
// By fclib.hpp: what is read frees itself, and what fails throws.
#include <array>
#include <fclib.hpp>
#include <iostream>
#include <string>

namespace {

/// A ball of 1 kg falls on a plane while it slides.
void write_ball(const std::string& path) {
  // u = W r + q with W = 1 / mass; the arrays must outlive the struct that points to them
  const std::array<double, 9> inverse_mass{1, 0, 0, 0, 1, 0, 0, 0, 1};
  std::array<double, 3> q{-1, 2, 0};
  std::array<double, 1> mu{0.5};
  std::string title = "a ball on a plane";
  fclib_info info{title.data(), nullptr, nullptr};
  fclib_matrix W = fclib::dense(3, 3, inverse_mass);
  fclib_local problem{};
  problem.W = &W;
  problem.q = q.data();
  problem.mu = mu.data();
  problem.spacedim = 3;
  problem.info = &info;
  fclib::validate(problem);
  fclib::write(path, problem);
}

void run(const std::string& path, const std::string& solver) {
  fclib_set_write_mode(FCLIB_WRITE_REPLACE);
  write_ball(path);

  const auto problem = fclib::read<fclib_local>(path);
  const fclib::Result result = fclib::solve(*problem, solver, {.tolerance = 1e-10});
  std::cout << problem->info->title << ": " << result.status_name() << " after "
            << result.iterations << " iterations\nr =";
  for (const double component : result.solution.r) std::cout << ' ' << component;
  std::cout << "\nmerit " << fclib::merit(*problem, result.solution) << '\n';
  fclib::write_solution(path, result.solution);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::cerr << "usage: " << argv[0] << " FILE [SOLVER]\n";
    return 2;
  }
  fclib_set_error_handler(nullptr, nullptr);  // what fails is thrown, and told once
  try {
    run(argv[1], argc > 2 ? argv[2] : "auto");
  } catch (const fclib::Error& error) {
    std::cerr << error.what() << '\n';
    return 1;
  }
}
