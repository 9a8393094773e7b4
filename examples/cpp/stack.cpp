// A problem with its bodies, to be seen by `fclib view FILE`: a box of 1 kg rests on four corners
// on a table, while a ball of 2 kg falls on it: stack FILE.
#include <array>
#include <cstdio>
#include <exception>
#include <fclib.hpp>
#include <numeric>
#include <string>
#include <vector>

namespace {

constexpr double step = 1e-3;     // [s]
constexpr double gravity = 9.81;  // [m/s^2]
constexpr double half = 0.1;      // half edges of the box [m]
constexpr double radius = 0.05;   // of the ball [m]
constexpr double box_mass = 1;    // [kg]
constexpr double ball_mass = 2;   // [kg]
constexpr double ball_speed = 1;  // downwards [m/s]
constexpr int contacts = 5;       // four corners, and the ball
constexpr int components = 3 * contacts;
constexpr int freedoms = 6 + 3;  // the box turns, the ball does not

using Point = std::array<double, 3>;

/// The velocity of a point of the box in a direction, by its six velocities.
std::array<double, 6> row(const Point& arm, const Point& along) {
  return {along[0],
          along[1],
          along[2],
          arm[1] * along[2] - arm[2] * along[1],
          arm[2] * along[0] - arm[0] * along[2],
          arm[0] * along[1] - arm[1] * along[0]};
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) return std::fprintf(stderr, "usage: %s FILE\n", argv[0]), 2;
  const std::string path = argv[1];
  constexpr std::array<Point, 3> frame{{{0, 0, 1}, {1, 0, 0}, {0, 1, 0}}};  // N, T1, T2

  // where the bodies touch: corners on the table, then the ball on the box
  std::vector<double> point;
  std::vector<int> body;
  for (const double x : {-half, half}) {
    for (const double y : {-half, half}) {
      point.insert(point.end(), {x, y, 0});
      body.insert(body.end(), {0, 1});
    }
  }
  point.insert(point.end(), {0, 0, 2 * half});
  body.insert(body.end(), {1, 2});

  // H by columns: what a reaction does to the velocities, on the second body and against the first
  std::vector<double> H(freedoms * components);
  for (int contact = 0; contact < contacts; ++contact) {
    const auto at = 3 * static_cast<std::size_t>(contact);
    const Point arm{point[at], point[at + 1], point[at + 2] - half};
    for (std::size_t k = 0; k < 3; ++k) {
      double* const column = H.data() + freedoms * (at + k);
      const bool on_box = contact < 4;
      const std::array<double, 6> of_box = row(arm, frame[k]);
      for (std::size_t i = 0; i < 6; ++i) column[i] = on_box ? of_box[i] : -of_box[i];
      for (std::size_t i = 0; i < 3 && !on_box; ++i) column[6 + i] = frame[k][i];
    }
  }

  const double inertia = box_mass * (2 * half) * (2 * half) / 6;  // of a cube
  const std::vector<double> masses{box_mass, box_mass,  box_mass,  inertia,  inertia,
                                   inertia,  ball_mass, ball_mass, ball_mass};
  std::vector<int> diagonal(freedoms);
  std::iota(diagonal.begin(), diagonal.end(), 0);
  std::vector<double> f(freedoms);  // M v without reactions
  f[2] = -box_mass * gravity * step;
  f[8] = -ball_mass * (ball_speed + gravity * step);
  std::vector<double> w(components);
  std::vector<double> mu(contacts, 0.6);

  try {
    fclib_matrix mass = fclib::triplets(freedoms, freedoms, diagonal, diagonal, masses);
    fclib_matrix jacobian = fclib::dense(freedoms, components, H);
    fclib_global problem{};
    problem.M = &mass;
    problem.H = &jacobian;
    problem.f = f.data();
    problem.w = w.data();
    problem.mu = mu.data();
    problem.spacedim = 3;

    fclib_set_write_mode(FCLIB_WRITE_REPLACE);  // the file may be there from the last time
    fclib::write(path, problem);
    const fclib::Result result = fclib::solve(problem);
    std::printf("%s, error %.1e\n", fclib_status_name(result.status), result.error);
    fclib::write_solution(path, result.solution);

    // the bodies: a table without end, the box, the ball
    const std::vector<std::string> name{"table", "box", "ball"};
    const std::vector<double> place{0, 0, 0, 0, 0, half, 0, 0, 2 * half + radius};
    const std::vector<double> size{0.3, 0.3, 0, half, half, half, radius, 0, 0};
    const std::vector<int> moves{0, 1, 1};
    const std::vector<int> kind{FCLIB_PLANE, FCLIB_BOX, FCLIB_SPHERE};
    std::vector<double> normal;
    std::vector<double> tangent;
    for (int contact = 0; contact < contacts; ++contact) {
      normal.insert(normal.end(), frame[0].begin(), frame[0].end());
      tangent.insert(tangent.end(), frame[1].begin(), frame[1].end());
    }
    fclib::write_geometry(path, {.body = body,
                                 .point = point,
                                 .normal = normal,
                                 .tangent = tangent,
                                 .name = name,
                                 .moves = moves,
                                 .place = place,
                                 .shape_kind = kind,
                                 .shape_size = size});
    return result.converged() ? 0 : 1;
  } catch (const std::exception&) {
    return 1;  // the library has said why
  }
}
