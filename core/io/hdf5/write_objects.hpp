// Groups, datasets and attributes, as small as HDF5 can write them, and with the same bytes each
// time.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "io/hdf5/handles.hpp"

namespace fclib::hdf5 {

/// How a whole file is written. The properties are made once: HDF5 needs longer to make them than
/// to write a number.
struct Style {
  /// `lend` gets numbers that stay where they are until the file is written.
  Style(int compression, std::function<void(const void* data, std::size_t size)> lend);

  int compression;
  std::function<void(const void* data, std::size_t size)> lend;
  Handle group;
  Handle plain;     ///< a dataset in one piece
  Handle compact;   ///< a dataset in its own header
  Handle deflated;  ///< a dataset in chunks, whose size is set for each
  Handle shuffled;  ///< the same, shuffled first
};

/// A group to write into, and how to write.
struct Target : Group {
  const Style* style = nullptr;
};

/// What makes small groups small; for the properties of a group or of a file.
void keep_small(hid_t properties);

Handle create_group(const Target& parent, const std::string& name);

/// A new group inside another one, written in the same way.
class NewGroup {
 public:
  NewGroup(const Target& parent, const std::string& name)
      : handle_(create_group(parent, name)),
        target_{{handle_.id(), parent.child(name)}, parent.style} {}
  [[nodiscard]] const Target& target() const { return target_; }

 private:
  Handle handle_;
  Target target_;
};

void write_numbers(const Target& group, const std::string& name, const double* values,
                   std::size_t size);
void write_numbers(const Target& group, const std::string& name, const std::int32_t* values,
                   std::size_t size);

/// Values is any vector of doubles or of 32-bit integers.
template <class Values>
void write_numbers(const Target& group, const std::string& name, const Values& values) {
  write_numbers(group, name, values.data(), static_cast<std::size_t>(values.size()));
}

/// The same for values that stay where they are until the file is written. They are not copied.
template <class Values>
void write_lasting(const Target& group, const std::string& name, const Values& values) {
  group.style->lend(values.data(), static_cast<std::size_t>(values.size()) * sizeof *values.data());
  write_numbers(group, name, values);
}

template <class Number>
void write_number(const Target& group, const std::string& name, Number value) {
  write_numbers(group, name, &value, 1);
}

void write_text(const Target& group, const std::string& name, const std::string& text);

/// A new attribute of the type `stored`, from the type `memory`.
void write_attribute(const Group& group, const char* name, hid_t stored, const Handle& space,
                     hid_t memory, const void* value);
void write_text_attribute(const Group& group, const char* name, const std::string& text);
void write_number_attribute(const Group& group, const char* name, double value);

}  // namespace fclib::hdf5
