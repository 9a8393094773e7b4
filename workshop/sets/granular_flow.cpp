// granular_flow.cpp: spheres settle behind a gate in a channel; the gate opens, and they flow out.
//
//     c++ -O2 -std=c++20 -ffp-contract=off -o flow workshop/sets/granular_flow.cpp
//     ./flow LONG WIDE HIGH SEED STATES > FILE
//
// Moreau-Jean stepping by the law of gaps, with Gauss-Seidel over the contacts: each step takes
// SWEEPS of them from the last impulses of the same pairs. The local problem of two spheres is
// solved exactly, as its matrix is diagonal: 1/m + 1/m' along N, 7/2 of that along T.
//
// All is measured in the largest diameter d, in sqrt(d / g) and in the mass of the largest sphere.
// Prints, of each of STATES states at equal times from the opening to the end of the flow, a line
// with the time, then of each sphere its place, velocity and spin; before them the number of
// spheres, the channel's width, the time step and all radii.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <unordered_map>
#include <vector>

namespace {

constexpr double MU = 0.5;         // of spheres and walls
constexpr double SMALLEST = 0.8;   // radius, of the largest one
constexpr double PITCH = 1.05;     // of the lattice of the start
constexpr double REACH = 0.05;     // largest gap of a contact
constexpr double SHARE = 0.2;      // of a penetration that is undone in a step
constexpr double STRIDE = 0.25;    // what the fastest sphere may move in a step
constexpr double SETTLING = 0.75;  // time behind the gate, in times of fall from the top
constexpr double FLOWING = 1.75;   // time after it opens, likewise
constexpr double FAR = 1e9;
constexpr int SWEEPS = 20;
constexpr int WALLS = 5;  // the numbers -1 to -5

using Three = std::array<double, 3>;

Three operator+(Three a, Three b) { return {a[0] + b[0], a[1] + b[1], a[2] + b[2]}; }
Three operator-(Three a, Three b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
Three operator*(double s, Three a) { return {s * a[0], s * a[1], s * a[2]}; }
double dot(Three a, Three b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Three cross(Three a, Three b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

uint64_t splitmix(uint64_t& state) {
  uint64_t z = (state += 0x9e3779b97f4a7c15ull);
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
  return z ^ (z >> 31);
}
double uniform(uint64_t& state) { return static_cast<double>(splitmix(state) >> 11) * 0x1p-53; }

struct Sphere {
  Three x, v, w;
  double radius, mass;
};

struct Contact {
  int first, second;  // spheres; first < 0: a wall
  double gap;
  Three normal;  // from the first to the second
  Three p;       // impulse on the second
  uint64_t key;
};

struct Channel {
  double wide, gate;  // an open gate is far away
};

void add(std::vector<Contact>& found, int first, int second, double gap, Three normal) {
  const uint64_t key = (static_cast<uint64_t>(first + WALLS) << 32) | static_cast<uint64_t>(second);
  if (gap < REACH) found.push_back({first, second, gap, normal, {0, 0, 0}, key});
}

// all contacts, by cells of a diameter and the reach
std::vector<Contact> contacts_of(const std::vector<Sphere>& spheres, const Channel& channel) {
  const double edge = 1.0 + REACH;
  double high = 0, far = 0;
  for (const Sphere& s : spheres) high = std::max(high, s.x[2]), far = std::max(far, s.x[0]);
  const int nx = static_cast<int>(far / edge) + 2, ny = static_cast<int>(channel.wide / edge) + 2;
  const int nz = static_cast<int>(high / edge) + 2;
  auto cell = [&](double v, int n) { return std::clamp(static_cast<int>(v / edge), 0, n - 1); };
  std::vector<int> head(static_cast<size_t>(nx) * ny * nz, -1), next(spheres.size(), -1);
  std::vector<Contact> found;
  for (int i = 0; i < static_cast<int>(spheres.size()); ++i) {
    const Sphere& s = spheres[i];
    const int a = cell(s.x[0], nx), b = cell(s.x[1], ny), c = cell(s.x[2], nz);
    for (int u = std::max(a - 1, 0); u <= std::min(a + 1, nx - 1); ++u)
      for (int v = std::max(b - 1, 0); v <= std::min(b + 1, ny - 1); ++v)
        for (int w = std::max(c - 1, 0); w <= std::min(c + 1, nz - 1); ++w)
          for (int j = head[(static_cast<size_t>(u) * ny + v) * nz + w]; j >= 0; j = next[j]) {
            const Three arm = s.x - spheres[j].x;
            const double far2 = dot(arm, arm), sum = s.radius + spheres[j].radius;
            if (far2 >= (sum + REACH) * (sum + REACH)) continue;
            const double distance = std::sqrt(far2);
            add(found, j, i, distance - sum, (1 / distance) * arm);
          }
    const size_t place = (static_cast<size_t>(a) * ny + b) * nz + c;
    next[i] = head[place], head[place] = i;
    const double r = s.radius;
    add(found, -1, i, s.x[2] - r, {0, 0, 1});
    add(found, -2, i, s.x[0] - r, {1, 0, 0});
    add(found, -3, i, s.x[1] - r, {0, 1, 0});
    add(found, -4, i, channel.wide - s.x[1] - r, {0, -1, 0});
    add(found, -5, i, channel.gate - s.x[0] - r, {-1, 0, 0});
  }
  return found;
}

void push(Sphere& s, double sign, Three normal, Three p) {
  // the lever goes from the centre to the surface: -sign r n
  s.v = s.v + (sign / s.mass) * p;
  s.w = s.w - (2.5 / (s.mass * s.radius)) * cross(normal, p);
}

void solve(std::vector<Sphere>& spheres, std::vector<Contact>& contacts, double h) {
  Sphere still{{0, 0, 0}, {0, 0, 0}, {0, 0, 0}, 1, 0};
  for (Contact& c : contacts) {
    if (c.first >= 0) push(spheres[c.first], -1, c.normal, c.p);
    push(spheres[c.second], 1, c.normal, c.p);
  }
  for (int sweep = 0; sweep < SWEEPS; ++sweep)
    for (Contact& c : contacts) {
      Sphere& b = spheres[c.second];
      Sphere& a = c.first >= 0 ? spheres[c.first] : still;
      const double inverse = 1 / b.mass + (c.first >= 0 ? 1 / a.mass : 0);
      Three u = b.v - b.radius * cross(b.w, c.normal);
      if (c.first >= 0) u = u - a.v - a.radius * cross(a.w, c.normal);
      const double un = dot(u, c.normal);
      const double pn = dot(c.p, c.normal);
      const double aim = pn - (un + (c.gap > 0 ? c.gap : SHARE * c.gap) / h) / inverse;
      Three p{0, 0, 0};
      if (aim > 0) {
        const Three ut = u - un * c.normal;
        Three pt = (c.p - pn * c.normal) - (1 / (3.5 * inverse)) * ut;
        const double size = std::sqrt(dot(pt, pt));
        if (size > MU * aim) pt = (MU * aim / size) * pt;
        p = aim * c.normal + pt;
      }
      const Three change = p - c.p;
      if (c.first >= 0) push(a, -1, c.normal, change);
      push(b, 1, c.normal, change);
      c.p = p;
    }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 6) return std::fprintf(stderr, "flow LONG WIDE HIGH SEED STATES\n"), 2;
  const int nx = std::atoi(argv[1]), ny = std::atoi(argv[2]), nz = std::atoi(argv[3]);
  uint64_t random = std::strtoull(argv[4], nullptr, 10);
  const int states = std::atoi(argv[5]);
  std::vector<Sphere> spheres;
  for (int k = 0; k < nz; ++k)
    for (int i = 0; i < nx; ++i)
      for (int j = 0; j < ny; ++j) {
        const double radius = 0.5 * (SMALLEST + (1 - SMALLEST) * uniform(random));
        const double room = 0.5 * PITCH - radius;
        auto shift = [&] { return room * (2 * uniform(random) - 1); };
        const Three x{PITCH * (i + 0.5) + shift(), PITCH * (j + 0.5) + shift(),
                      PITCH * (k + 0.5) + shift()};
        spheres.push_back({x, {0, 0, 0}, {0, 0, 0}, radius, 8 * radius * radius * radius});
      }
  Channel channel{PITCH * ny, PITCH * nx};
  const double fall = std::sqrt(2 * PITCH * nz);  // also the largest speed
  const double h = STRIDE / fall;
  const int opening = static_cast<int>(SETTLING * fall / h);
  const int end = opening + static_cast<int>(FLOWING * fall / h);
  std::printf("%zu %.17g %.17g\n", spheres.size(), channel.wide, h);
  for (const Sphere& s : spheres) std::printf("%.17g\n", s.radius);
  std::unordered_map<uint64_t, Three> last;
  for (int step = 0, printed = 0; step <= end; ++step) {
    if (step == opening) channel.gate = FAR;
    // the states are at equal distances, the first at the opening and the last at the end
    if (step == opening + printed * (end - opening) / (states - 1)) {
      ++printed;
      std::printf("%.17g\n", (step - opening) * h);
      for (const Sphere& s : spheres)
        std::printf("%.9g %.9g %.9g %.6g %.6g %.6g %.6g %.6g %.6g\n", s.x[0], s.x[1], s.x[2],
                    s.v[0], s.v[1], s.v[2], s.w[0], s.w[1], s.w[2]);
    }
    for (Sphere& s : spheres) s.v[2] -= h;
    std::vector<Contact> contacts = contacts_of(spheres, channel);
    for (Contact& c : contacts)
      if (auto known = last.find(c.key); known != last.end()) c.p = known->second;
    solve(spheres, contacts, h);
    last.clear();
    size_t pressing = 0;
    double deepest = 0;
    for (const Contact& c : contacts)
      if (dot(c.p, c.normal) > 0) last[c.key] = c.p, ++pressing, deepest = std::min(deepest, c.gap);
    double fastest = 0;
    for (Sphere& s : spheres) {
      s.x = s.x + h * s.v;
      fastest = std::max(fastest, dot(s.v, s.v));
    }
    if (step % 20 == 0)
      std::fprintf(stderr, "step %d of %d: %zu contacts, %zu press, deepest %.3g, fastest %.3g\n",
                   step, end, contacts.size(), pressing, deepest, std::sqrt(fastest));
  }
}
