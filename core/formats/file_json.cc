#include "core/formats/file_json.h"

#include <cstddef>
#include <cstdint>
#include <string>

#include "absl/strings/str_cat.h"
#include "nlohmann/json.hpp"

namespace pepeseg {
namespace {

using nlohmann::json;

// Counts the nesting of a JSON text. nlohmann's SAX parser calls these methods, whose names it
// requires, and stops when one returns false.
class DepthLimiter {
 public:
  bool too_deep() const { return too_deep_; }

  bool null() { return true; }
  bool boolean(bool) { return true; }
  bool number_integer(int64_t) { return true; }
  bool number_unsigned(uint64_t) { return true; }
  bool number_float(double, const std::string&) { return true; }
  bool string(std::string&) { return true; }
  bool binary(json::binary_t&) { return true; }
  bool key(std::string&) { return true; }
  bool start_object(size_t) { return Enter(); }
  bool end_object() { return Leave(); }
  bool start_array(size_t) { return Enter(); }
  bool end_array() { return Leave(); }
  bool parse_error(size_t, const std::string&, const json::exception&) { return false; }

 private:
  bool Enter() {
    too_deep_ = ++depth_ > kMaxJsonDepth;
    return !too_deep_;
  }
  bool Leave() {
    --depth_;
    return true;
  }

  int depth_ = 0;
  bool too_deep_ = false;
};

}  // namespace

absl::StatusOr<json> ParseFileJson(absl::string_view text) {
  // Parses twice: the first pass only measures, the second builds the document.
  DepthLimiter limiter;
  const bool parsed = json::sax_parse(text.begin(), text.end(), &limiter);
  if (limiter.too_deep()) {
    return absl::InvalidArgumentError(
        absl::StrCat("is nested deeper than ", kMaxJsonDepth, " levels"));
  }
  if (!parsed) return absl::InvalidArgumentError("is not JSON, or cut short");
  // Cannot fail: the first pass has parsed the same text.
  return json::parse(text.begin(), text.end(), nullptr, /*allow_exceptions=*/false);
}

}  // namespace pepeseg
