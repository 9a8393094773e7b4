// Datasets of numbers and of text, read with distrust: HDF5 is never asked for much more memory
// than the file has data.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "io/hdf5/chunks.hpp"
#include "io/hdf5/handles.hpp"

namespace fclib::hdf5 {

/// An open dataset of numbers whose type and size were checked. If it has more than one dimension,
/// it is read in the order of HDF5, the last one fastest, as by libfclib 3.1.
struct Numbers {
  Handle id;
  std::string path;
  std::size_t size;
  bool real;    ///< floating point, even if integers are asked for: MATLAB writes so
  bool narrow;  ///< integers of 32 bits at most, with their sign
  bool flat;    ///< at most one extent is not 1
  Packing packing;
};

/// Also throws if the numbers, or some of them, were never written.
Numbers open_numbers(const Group& group, const std::string& name);

/// Whether a dataset was declared and never written: libfclib 3.1 stores a missing vector so.
bool is_unwritten(const Group& group, const std::string& name);

/// Reads all the numbers of the dataset into memory that has room for them.
void read_into(const Numbers& dataset, double* values);
void read_into(const Numbers& dataset, std::int32_t* values);

/// Values is any vector of doubles that is constructed with a size.
template <class Values>
Values read_doubles(const Group& group, const std::string& name) {
  const Numbers dataset = open_numbers(group, name);
  Values values(static_cast<decltype(Values().size())>(dataset.size));
  read_into(dataset, values.data());
  return values;
}

/// Values is any vector of 32-bit integers that is constructed with a size.
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

/// A dataset of one dimension that may have more entries than memory has room for.
struct Rows {
  Handle id;
  std::string path;
  hsize_t size;
  hsize_t chunk;  ///< entries of a chunk, 0 if it is not in chunks
};

/// Opens a dataset of entries of this class. Only what all of it needs is checked.
Rows open_rows(const Group& group, const std::string& name, H5T_class_t kind);

/// Reads entries that lie in the dataset as the type `memory`. Throws if some were never written.
/// The caller asks for no more than the file can hold: see require_held().
void read_rows(const Rows& rows, hsize_t first, hsize_t count, hid_t memory, void* values);

/// Throws if so many bytes cannot come from the file of a dataset, however it is packed.
void require_held(const Rows& rows, double bytes, const std::string& where);

/// A text of fixed length (with or without its final NUL), of variable length, or stored as bytes.
std::string read_text(const Group& group, const std::string& name);

}  // namespace fclib::hdf5
