#pragma once

#include <cstdint>
#include <cstring>
#include <span>

#include "absl/strings/string_view.h"

namespace pepeseg {

// Reads little-endian values from the front of a buffer, which must outlive the reader. A read past
// the end yields zeros and makes ok() false for good, so callers may check once per record.
class ByteReader {
 public:
  explicit ByteReader(absl::string_view bytes) : bytes_(bytes) {}

  bool ok() const { return ok_; }
  size_t offset() const { return offset_; }
  size_t remaining() const { return bytes_.size() - offset_; }

  // Returns the next value. T must be trivially copyable; the bytes are not swapped, because the
  // program runs on little-endian machines only.
  template <class T>
  T Take() {
    T value{};
    if (Skip(sizeof(T))) std::memcpy(&value, bytes_.data() + offset_ - sizeof(T), sizeof(T));
    return value;
  }
  template <class T>
  void TakeAll(std::span<T> values) {
    for (T& value : values) value = Take<T>();
  }
  // Returns the text up to the next NUL byte and skips that byte. Without a NUL byte, returns an
  // empty text and makes ok() false.
  absl::string_view TakeString() {
    const size_t end = bytes_.find('\0', offset_);
    if (end == absl::string_view::npos) {
      ok_ = false;
      return {};
    }
    const absl::string_view text = bytes_.substr(offset_, end - offset_);
    offset_ = end + 1;
    return text;
  }
  // Skips `count` bytes. Returns ok().
  bool Skip(uint64_t count) {
    ok_ = ok_ && count <= remaining();
    if (ok_) offset_ += count;
    return ok_;
  }

 private:
  absl::string_view bytes_;
  size_t offset_ = 0;
  bool ok_ = true;
};

}  // namespace pepeseg
