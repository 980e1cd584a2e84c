#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

// The wire format of protobuf, as far as ONNX models need it: neither onnx.proto nor the protobuf
// library is needed to read them.
namespace pepeseg {

// Field numbers of onnx.proto.
inline constexpr uint64_t kModelGraph = 7;
inline constexpr uint64_t kGraphNode = 1, kGraphInitializer = 5, kGraphInput = 11,
                          kGraphOutput = 12, kGraphValueInfo = 13;
inline constexpr uint64_t kNodeInput = 1, kNodeOutput = 2, kNodeType = 4, kNodeAttribute = 5;
inline constexpr uint64_t kAttributeName = 1, kAttributeTensor = 5;
inline constexpr uint64_t kTensorShape = 1, kTensorType = 2, kTensorName = 8, kTensorRaw = 9;

// Wire types.
inline constexpr uint64_t kVarint = 0, kFixed64 = 1, kBytes = 2, kFixed32 = 5;

struct OnnxField {
  uint64_t number = 0;
  uint64_t value = 0;        // of a kVarint field; 0 for other wire types
  std::string_view content;  // bytes of a kBytes field; empty for other wire types
  std::string_view whole;    // the field with its tag
};

// Reads the fields of a message one after the other. Views point into the message's bytes.
class OnnxFieldReader {
 public:
  explicit OnnxFieldReader(std::string_view bytes) : rest_(bytes) {}

  // Returns nullopt at the end, and when the bytes are not a message: see ok().
  std::optional<OnnxField> Next() {
    if (rest_.empty() || !ok_) return std::nullopt;
    const std::string_view start = rest_;
    OnnxField field;
    // Tag: field number << 3 | wire type. Groups (3 and 4) are obsolete and not in ONNX.
    const uint64_t tag = Varint();
    field.number = tag >> 3;
    switch (tag & 7) {
      case kVarint:
        field.value = Varint();
        break;
      case kFixed64:
        Take(8);
        break;
      case kBytes:
        field.content = Take(Varint());
        break;
      case kFixed32:
        Take(4);
        break;
      default:
        ok_ = false;
    }
    field.whole = start.substr(0, start.size() - rest_.size());
    return ok_ ? std::optional(field) : std::nullopt;
  }
  bool ok() const { return ok_; }

 private:
  uint64_t Varint() {
    uint64_t value = 0;
    // At most 10 bytes: a longer number is refused instead of shifted out of range.
    for (int shift = 0; shift < 64; shift += 7) {
      if (rest_.empty()) break;
      const auto byte = static_cast<uint8_t>(rest_.front());
      rest_.remove_prefix(1);
      value |= static_cast<uint64_t>(byte & 127) << shift;
      if (byte < 128) return value;
    }
    ok_ = false;
    return 0;
  }
  std::string_view Take(uint64_t size) {
    // A length that exceeds the message is that of a damaged or hostile file.
    if (size > rest_.size()) {
      ok_ = false;
      return {};
    }
    const std::string_view taken = rest_.substr(0, size);
    rest_.remove_prefix(size);
    return taken;
  }

  std::string_view rest_;
  bool ok_ = true;
};

}  // namespace pepeseg
