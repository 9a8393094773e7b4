// Datasets of numbers and of text, read with distrust: nothing is asked of HDF5 that would take
// much more memory than the file has data.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "io/hdf5/chunks.hpp"
#include "io/hdf5/handles.hpp"

namespace fclib::hdf5 {

/// An open dataset of numbers whose type and size have been looked at, and found believable. More
/// dimensions than one are read in the order of HDF5, the last one fastest, as by libfclib 3.1.
struct Numbers {
  Handle id;
  std::string path;
  std::size_t size;
  bool real;    ///< of floating point, though integers may be asked for: MATLAB writes so
  bool narrow;  ///< integers of 32 bits at most, with their sign
  bool flat;    ///< at most one extent is not 1
  Packing packing;
};

/// Fails also where the numbers, or some of them, were never written.
Numbers open_numbers(const Group& group, const std::string& name);

/// Whether a dataset was declared and never written: so libfclib 3.1 stores a vector that it is not
/// given.
bool is_unwritten(const Group& group, const std::string& name);

/// All the numbers of the dataset, into memory that has room for them.
void read_into(const Numbers& dataset, double* values);
void read_into(const Numbers& dataset, std::int32_t* values);

/// Values is any vector of doubles that is made with a size.
template <class Values>
Values read_doubles(const Group& group, const std::string& name) {
  const Numbers dataset = open_numbers(group, name);
  Values values(static_cast<decltype(Values().size())>(dataset.size));
  read_into(dataset, values.data());
  return values;
}

/// Values is any vector of integers of 32 bits that is made with a size.
template <class Values>
Values read_indices(const Group& group, const std::string& name) {
  const Numbers dataset = open_numbers(group, name);
  Values values(dataset.size);
  read_into(dataset, values.data());
  return values;
}

/// A dataset of one number.
template <class Number>
Number read_number(const Group& group, const std::string& name) {
  const Numbers dataset = open_numbers(group, name);
  std::vector<Number> values(dataset.size);
  read_into(dataset, values.data());
  if (values.size() != 1) {
    fail(dataset.path, "has " + std::to_string(values.size()) + " entries, expected one");
  }
  return values.front();
}

/// Text of fixed length, with or without its final NUL, of variable length, or as its bytes.
std::string read_text(const Group& group, const std::string& name);

}  // namespace fclib::hdf5
