#include "contact/spin.hpp"

namespace fclib {

template class Product<double, 2, 1>;
template class Product<double, 2, 1, 2>;

}  // namespace fclib
