#include "contact/contact_functions.hpp"

#include <gtest/gtest.h>

#include "random_data.hpp"

namespace fclib {
namespace {

/// The generalised Jacobian beside central differences, at points away from the kinks by chance.
template <class Function>
void check_jacobians(const typename Function::Cone& cone, testing::RandomData& random) {
  using Vec = typename Function::Vec;
  using Mat = typename Function::Mat;
  constexpr double h = 1e-6;
  Vec rho = Vec::Constant(0.7);
  if (Function::split) rho[0] = 1.3;
  for (int k = 0; k < 200; ++k) {
    const Vec u = random.vector(Vec::RowsAtCompileTime);
    const Vec r = random.vector(Vec::RowsAtCompileTime);
    const Vec du = h * random.vector(Vec::RowsAtCompileTime);
    const Vec dr = h * random.vector(Vec::RowsAtCompileTime);
    Mat A;
    Mat B;
    Function::jacobian(cone, rho, u, r, A, B);
    const Vec change = Function::value(cone, rho, Vec(u + du), Vec(r + dr)) -
                       Function::value(cone, rho, Vec(u - du), Vec(r - dr));
    EXPECT_LE((change - 2 * (A * du + B * dr)).norm(), 1e-3 * h) << "point " << k;
  }
}

TEST(ContactFunctions, SlopesAreTheDerivatives) {
  testing::RandomData random(11);
  for (const double mu : {0.0, 0.3, 2.0}) {
    check_jacobians<AlartCurnier<Coulomb<2>>>(Coulomb<2>(mu), random);
    check_jacobians<AlartCurnier<Coulomb<3>>>(Coulomb<3>(mu), random);
    check_jacobians<AlartCurnier<Rolling<5>>>(Rolling<5>(mu, 0.1), random);
    check_jacobians<JeanMoreau<Coulomb<2>>>(Coulomb<2>(mu), random);
    check_jacobians<JeanMoreau<Coulomb<3>>>(Coulomb<3>(mu), random);
    check_jacobians<JeanMoreau<Rolling<3>>>(Rolling<3>(mu, 0.1), random);
    check_jacobians<NaturalMap<Coulomb<2>>>(Coulomb<2>(mu), random);
    check_jacobians<NaturalMap<Coulomb<3>>>(Coulomb<3>(mu), random);
    check_jacobians<NaturalMap<Rolling<5>>>(Rolling<5>(mu, 0.1), random);
    check_jacobians<FischerBurmeister<Coulomb<2>>>(Coulomb<2>(mu), random);
    check_jacobians<FischerBurmeister<Coulomb<3>>>(Coulomb<3>(mu), random);
  }
}

template <class Function>
void check_zeros() {
  using Vec = Eigen::Vector3d;
  const Coulomb<3> cone(0.5);
  for (const double rho : {0.1, 1.0, 7.0}) {
    const auto f = [&](const Vec& u, const Vec& r) {
      return Function::value(cone, Vec::Constant(rho), u, r).norm();
    };
    EXPECT_LE(f({1, 3, 4}, {0, 0, 0}), 1e-14);        // open
    EXPECT_LE(f({0, 0, 0}, {2, 0.3, 0.4}), 1e-14);    // stick
    EXPECT_LE(f({0, 3, 4}, {2, -0.6, -0.8}), 1e-13);  // slide
    EXPECT_GE(f({0, 3, 4}, {2, 0.6, 0.8}), 1e-2);     // friction pushes along
    EXPECT_GE(f({0, 3, 4}, {2, -0.3, -0.4}), 1e-2);   // too little of it
    EXPECT_GE(f({-1, 0, 0}, {0, 0, 0}), 1e-2);        // it penetrates
  }
}

TEST(ContactFunctions, ZerosAreTheContactLaw) {
  check_zeros<AlartCurnier<Coulomb<3>>>();
  check_zeros<JeanMoreau<Coulomb<3>>>();
  check_zeros<NaturalMap<Coulomb<3>>>();
  check_zeros<FischerBurmeister<Coulomb<3>>>();
}

}  // namespace
}  // namespace fclib
