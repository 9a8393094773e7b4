// jammed.cpp: spheres of radii that differ, in a cube, compressed through jamming.
//
//     c++ -O2 -std=c++20 -ffp-contract=off -o jammed workshop/sets/jammed.cpp && ./jammed COUNT
//     SEED OVERLAP
//
// The spheres repel each other and the walls by k times their overlap. Their radii grow in steps;
// after each the energy is minimised (FIRE, E. Bitzek et al., Physical Review Letters 97, 2006).
// Where it does not vanish, the step is taken back and halved, until the overlap that remains is
// about OVERLAP of a radius: just above jamming, in equilibrium. Prints the largest radius, then of
// each sphere its place, the edge of the cube being 1e13, and its radius, 800 to 1000 being the
// largest.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <utility>
#include <vector>

namespace {

constexpr double LOOSE = 1e-7;  // mean overlap, of a radius, of spheres that are free
using Vec = std::vector<double>;
using Pairs = std::vector<std::pair<int, int>>;

Pairs neighbours(const Vec& x, double reach) {
  const int n = static_cast<int>(x.size() / 3);
  const int cells = std::max(1, static_cast<int>(1.0 / reach));
  auto cell = [&](double v) { return std::clamp(static_cast<int>(v * cells), 0, cells - 1); };
  std::vector<std::vector<int>> grid(static_cast<size_t>(cells) * cells * cells);
  for (int i = 0; i < n; ++i)
    grid[(static_cast<size_t>(cell(x[3 * i])) * cells + cell(x[3 * i + 1])) * cells +
         cell(x[3 * i + 2])]
        .push_back(i);
  Pairs pairs;
  for (int i = 0; i < n; ++i)
    for (int a = -1; a <= 1; ++a)
      for (int b = -1; b <= 1; ++b)
        for (int c = -1; c <= 1; ++c) {
          const int p = cell(x[3 * i]) + a, q = cell(x[3 * i + 1]) + b, r = cell(x[3 * i + 2]) + c;
          if (std::min({p, q, r}) < 0 || std::max({p, q, r}) >= cells) continue;
          for (int j : grid[(static_cast<size_t>(p) * cells + q) * cells + r]) {
            if (j <= i) continue;
            double d2 = 0;
            for (int k = 0; k < 3; ++k)
              d2 += (x[3 * i + k] - x[3 * j + k]) * (x[3 * i + k] - x[3 * j + k]);
            if (d2 < reach * reach) pairs.emplace_back(i, j);
          }
        }
  return pairs;
}

// the forces, unit stiffness; returns the mean overlap, of a radius, of what overlaps
double forces(const Vec& x, const Vec& r, const Pairs& pairs, Vec& f) {
  std::fill(f.begin(), f.end(), 0.0);
  double sum = 0;
  int count = 0;
  for (auto [i, j] : pairs) {
    double d[3], d2 = 0;
    for (int k = 0; k < 3; ++k) d[k] = x[3 * i + k] - x[3 * j + k], d2 += d[k] * d[k];
    const double reach = r[i] + r[j];
    if (d2 >= reach * reach) continue;
    const double length = std::sqrt(d2), overlap = reach - length;
    for (int k = 0; k < 3; ++k) {
      const double push = overlap * d[k] / length;
      f[3 * i + k] += push, f[3 * j + k] -= push;
    }
    sum += overlap / r[i], ++count;
  }
  for (size_t i = 0; i < r.size(); ++i)
    for (int k = 0; k < 3; ++k) {
      const double low = r[i] - x[3 * i + k], high = x[3 * i + k] + r[i] - 1;
      if (low > 0) f[3 * i + k] += low, sum += low / r[i], ++count;
      if (high > 0) f[3 * i + k] -= high, sum += high / r[i], ++count;
    }
  return count ? sum / count : 0.0;
}

// minimise; the mean overlap that remains
double relax(Vec& x, const Vec& r, double exact, int most) {
  const double largest = *std::max_element(r.begin(), r.end());
  Vec v(x.size(), 0.0), f(x.size()), start = x;
  Pairs pairs = neighbours(x, 2.4 * largest);
  double h = 0.1, mix = 0.1, mean = 0;
  int good = 0;
  for (int step = 0; step < most; ++step) {
    mean = forces(x, r, pairs, f);
    double power = 0, ff = 0, vv = 0, far = 0, top = 0;
    for (size_t i = 0; i < x.size(); ++i) {
      power += f[i] * v[i], ff += f[i] * f[i], vv += v[i] * v[i];
      far = std::max(far, std::abs(x[i] - start[i])), top = std::max(top, std::abs(f[i]));
    }
    if (mean < LOOSE || top < exact * mean * largest) break;
    if (far > 0.1 * largest) pairs = neighbours(x, 2.4 * largest), start = x;
    if (power > 0) {
      const double turn = mix * std::sqrt(vv / ff);
      for (size_t i = 0; i < x.size(); ++i) v[i] = (1 - mix) * v[i] + turn * f[i];
      if (++good > 5) h = std::min(h * 1.1, 0.6), mix *= 0.99;
    } else {
      std::fill(v.begin(), v.end(), 0.0);
      h *= 0.5, mix = 0.1, good = 0;
    }
    for (size_t i = 0; i < x.size(); ++i) v[i] += h * f[i], x[i] += h * v[i];
  }
  return mean;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) return std::fprintf(stderr, "usage: jammed COUNT SEED OVERLAP\n"), 2;
  const int n = std::atoi(argv[1]);
  std::mt19937_64 random(static_cast<unsigned long>(std::atol(argv[2])));
  const double target = std::atof(argv[3]);
  auto uniform = [&] { return static_cast<double>(random() >> 11) * 0x1p-53; };
  Vec x(3 * n), unit(n), r(n);
  double volume = 0;
  for (double& radius : unit) {
    radius = 1e-3 * static_cast<double>(800 + random() % 201);
    volume += 4.18879 * radius * radius * radius;
  }
  for (double& place : x) place = 0.05 + 0.9 * uniform();
  auto scale = [&](double share) {
    for (int i = 0; i < n; ++i) r[i] = unit[i] * std::cbrt(share / volume);
  };
  double share = 0.35, step = 0.02;
  Vec loose = x;
  while (true) {
    Vec next = loose;
    scale(share + step);
    double mean = relax(next, r, 1e-6, 20000);
    // what is nearly loose may become so
    if (mean >= LOOSE && mean < 5 * target) mean = relax(next, r, 1e-9, 200000);
    std::fprintf(stderr, "share %.6f: mean overlap %.1e\n", share + step, mean);
    if (mean < LOOSE) {
      loose = next, share += step;
    } else if (mean < 2 * target) {
      x = next;
      break;
    } else {
      step *= 0.5;
    }
  }
  std::fprintf(stderr, "%d spheres, share %.6f\n", n, share + step);
  std::printf("%.17g\n", std::cbrt((share + step) / volume));
  for (int i = 0; i < n; ++i)
    std::printf("%.0f %.0f %.0f %.0f\n", 1e13 * x[3 * i], 1e13 * x[3 * i + 1], 1e13 * x[3 * i + 2],
                1e3 * unit[i]);
}
