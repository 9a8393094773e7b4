#include "reduced/convex_sets.hpp"

namespace fclib {

template <int N>
double curvature_bound(const ContactMatrix<N>& a) {
  return (0.5 * (a + a.transpose())).cwiseAbs().rowwise().sum().maxCoeff();
}

template double curvature_bound<1>(const ContactMatrix<1>&);
template double curvature_bound<2>(const ContactMatrix<2>&);
template double curvature_bound<3>(const ContactMatrix<3>&);
template double curvature_bound<4>(const ContactMatrix<4>&);
template double curvature_bound<5>(const ContactMatrix<5>&);
template double curvature_bound<6>(const ContactMatrix<6>&);

}  // namespace fclib
