#include "core/dataset/sam_masks.h"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/errors.h"
#include "core/base/status_macros.h"
#include "core/formats/rle.h"
#include "nlohmann/json.hpp"

namespace pepeseg {
namespace {

constexpr int64_t kMaxSide = 16384;  // of a mask, pixels
constexpr char kNoSegmentation[] = "has no \"segmentation\" with a \"size\": [height, width]";

// The part of the "segmentation" of one mask that has been read so far. If a key occurs twice, the
// last value counts.
struct Segmentation {
  std::vector<int64_t> size;  // [height, width]; at most 3 numbers are kept
  bool size_ok = false;       // "size" is a list of integers
  std::vector<int64_t> runs;
  std::string compressed;
  absl::Status counts;  // error of "counts", which sets `runs` or `compressed`

  // Resets everything, but keeps the memory of `runs` for the next mask.
  void Clear() {
    size.clear();
    size_ok = false;
    runs.clear();
    compressed.clear();
    counts = absl::InvalidArgumentError("\"counts\" is neither a list nor a string");
  }
};

// A state machine for the events of nlohmann's SAX parser, which requires the names of the public
// methods below Finish and stops when one returns false. Values that the format does not use are
// skipped without being stored.
class SamReader {
 public:
  using Json = nlohmann::json;

  SamReader(absl::string_view text, const std::string& name, const PhotoSize& photo)
      : name_(name), photo_(photo), builder_(photo.width, photo.height) {
    // A run takes at least two bytes of the text. Reserved once, because growing would take twice
    // the memory.
    const auto most = static_cast<size_t>(MaxRuns());
    mask_.runs.reserve(std::min(most, text.size() / 2 + 1));
  }

  // Returns the masks or the error. `parsed`: what the parser returned.
  absl::StatusOr<MaskSet> Finish(bool parsed) &&;

  bool null() { return Scalar(); }
  bool boolean(bool) { return Scalar(); }
  bool number_float(double, const std::string&) { return Scalar(); }
  bool binary(Json::binary_t&) { return Scalar(); }
  bool number_integer(int64_t value) { return Number(value); }
  bool number_unsigned(uint64_t value) {
    constexpr auto kMost = static_cast<uint64_t>(std::numeric_limits<int64_t>::max());
    return value > kMost ? Scalar() : Number(static_cast<int64_t>(value));
  }
  bool string(std::string& value);
  bool start_object(size_t);
  bool end_object() { return End(); }
  bool start_array(size_t);
  bool end_array() { return End(); }
  bool key(std::string& value) {
    if (num_skipped_ == 0) key_ = std::move(value);
    return true;
  }
  bool parse_error(size_t, const std::string&, const Json::exception&) { return false; }

 private:
  // The innermost array or object that is open and not skipped.
  enum class Place { kDocument, kList, kMask, kSegmentation, kSize, kRuns };

  int64_t MaxRuns() const { return int64_t{photo_.width} * photo_.height + 1; }
  bool Enter();
  // Skips the array or object that has just begun.
  bool SkipValue() {
    ++num_skipped_;
    return true;
  }
  bool End();
  bool Scalar();
  bool Number(int64_t value);
  // Records that a value has the wrong type for its place.
  void Misplaced();
  void BeginMask() {
    ++num_masks_;
    mask_.Clear();
  }
  void EndMask();
  absl::Status AddMask(const std::string& where);

  const std::string& name_;
  const PhotoSize& photo_;
  MaskSetBuilder builder_;
  Place place_ = Place::kDocument;
  int depth_ = 0;        // arrays and objects that are open
  int num_skipped_ = 0;  // how many of these are skipped
  std::string key_;      // the last key in place_
  Segmentation mask_;
  size_t num_masks_ = 0;
  bool is_list_ = true, too_deep_ = false;
  // Error of the first bad mask. The rest is still parsed, because errors of the whole file (not
  // JSON, too many masks) take precedence.
  absl::Status first_error_;
};

bool SamReader::Enter() {
  too_deep_ = ++depth_ > kMaxMaskJsonDepth;
  return !too_deep_;
}

// Arrays are used as the list of masks, as "size" and as "counts".
bool SamReader::start_array(size_t) {
  if (!Enter()) return false;
  if (num_skipped_ > 0) return SkipValue();
  if (place_ == Place::kDocument) {
    place_ = Place::kList;
    return true;
  }
  if (place_ == Place::kSegmentation && key_ == "size") {
    mask_.size.clear();
    mask_.size_ok = true;
    place_ = Place::kSize;
    return true;
  }
  if (place_ == Place::kSegmentation && key_ == "counts") {
    mask_.runs.clear();
    mask_.compressed.clear();
    mask_.counts = absl::OkStatus();
    place_ = Place::kRuns;
    return true;
  }
  Misplaced();
  return SkipValue();
}

// Objects are used as masks and as "segmentation".
bool SamReader::start_object(size_t) {
  if (!Enter()) return false;
  if (num_skipped_ > 0) return SkipValue();
  if (place_ == Place::kList) {
    BeginMask();
    place_ = Place::kMask;
    return true;
  }
  if (place_ == Place::kMask && key_ == "segmentation") {
    mask_.Clear();
    place_ = Place::kSegmentation;
    return true;
  }
  Misplaced();
  return SkipValue();
}

// Returns from an array or object to the one around it.
bool SamReader::End() {
  --depth_;
  if (num_skipped_ > 0) {
    --num_skipped_;
    return true;
  }
  switch (place_) {
    case Place::kSize:
    case Place::kRuns:
      place_ = Place::kSegmentation;
      break;
    case Place::kSegmentation:
      place_ = Place::kMask;
      break;
    case Place::kMask:
      EndMask();
      place_ = Place::kList;
      break;
    default:
      place_ = Place::kDocument;
  }
  return true;
}

// What a wrong type means depends on the place: the document is not a list, an element of the list
// is a mask without content, or a part of the segmentation is invalid. Unknown keys are ignored.
void SamReader::Misplaced() {
  switch (place_) {
    case Place::kDocument:
      is_list_ = false;
      return;
    case Place::kList:
      BeginMask();
      EndMask();
      return;
    case Place::kMask:
      if (key_ == "segmentation") mask_.Clear();
      return;
    case Place::kSegmentation:
      if (key_ == "size") mask_.size_ok = false;
      if (key_ == "counts") {
        mask_.counts = absl::InvalidArgumentError("\"counts\" is neither a list nor a string");
      }
      return;
    case Place::kSize:
      mask_.size_ok = false;
      return;
    case Place::kRuns:
      if (!mask_.counts.ok()) return;
      mask_.counts = absl::InvalidArgumentError(
          absl::StrCat("run ", mask_.runs.size(), " is not a whole number"));
  }
}

bool SamReader::Scalar() {
  if (num_skipped_ == 0) Misplaced();
  return true;
}

bool SamReader::Number(int64_t value) {
  if (num_skipped_ > 0 || (place_ != Place::kSize && place_ != Place::kRuns)) return Scalar();
  if (place_ == Place::kSize) {
    if (mask_.size.size() < 3) mask_.size.push_back(value);
  } else if (mask_.counts.ok() && static_cast<int64_t>(mask_.runs.size()) < MaxRuns()) {
    mask_.runs.push_back(value);
  } else if (mask_.counts.ok()) {
    mask_.counts = absl::InvalidArgumentError(
        absl::StrCat("has more than ", MaxRuns(), " runs, one more than the image has pixels"));
  }
  return true;
}

bool SamReader::string(std::string& value) {
  if (num_skipped_ > 0 || place_ != Place::kSegmentation || key_ != "counts") return Scalar();
  mask_.compressed = std::move(value);
  mask_.runs.clear();
  mask_.counts = absl::OkStatus();
  return true;
}

// Adds the mask that has just ended, unless an earlier one was bad or there are too many.
void SamReader::EndMask() {
  if (!first_error_.ok() || num_masks_ > kMaxMasksOfView) return;
  first_error_ = AddMask(absl::StrCat(name_, ": mask ", num_masks_ - 1));
}

// Converts the runs to pixels and adds them to the set.
absl::Status SamReader::AddMask(const std::string& where) {
  if (!mask_.size_ok || mask_.size.size() != 2) return Refused(where, kNoSegmentation);
  const int64_t height = mask_.size[0], width = mask_.size[1];
  if (width < 1 || height < 1 || width > kMaxSide || height > kMaxSide) {
    return Refused(where, absl::StrCat("has ", width, "x", height,
                                       " pixels, each side must be 1 to ", kMaxSide));
  }
  RETURN_IF_ERROR(CheckMaskShape(where, width, height, photo_));
  if (!mask_.counts.ok()) return Refused(where, mask_.counts.message());
  absl::StatusOr<std::vector<int64_t>> unpacked = ParseCocoCounts(mask_.compressed, MaxRuns());
  if (!unpacked.ok()) return Refused(where, unpacked.status().message());
  const auto w = static_cast<int>(width), h = static_cast<int>(height);
  absl::StatusOr<std::vector<uint32_t>> pixels =
      PixelsOfRuns(mask_.compressed.empty() ? mask_.runs : *unpacked, w, h);
  if (!pixels.ok()) return Refused(where, pixels.status().message());
  return pepeseg::AddMask(where, ScaledPixels(*std::move(pixels), w, h, photo_), builder_);
}

absl::StatusOr<MaskSet> SamReader::Finish(bool parsed) && {
  if (too_deep_) {
    return Refused(name_, absl::StrCat("is nested deeper than ", kMaxMaskJsonDepth, " levels"));
  }
  if (!parsed) return Refused(name_, "is not JSON, or cut short");
  if (!is_list_) return Refused(name_, "is not a list of masks");
  if (num_masks_ > kMaxMasksOfView) {
    return Refused(name_,
                   absl::StrCat("has ", num_masks_, " masks, the limit is ", kMaxMasksOfView));
  }
  RETURN_IF_ERROR(first_error_);
  return std::move(builder_).Build();
}

}  // namespace

absl::StatusOr<MaskSet> ParseSamMasks(absl::string_view text, const std::string& name,
                                      const PhotoSize& photo) {
  SamReader reader(text, name, photo);
  const bool parsed = nlohmann::json::sax_parse(text.begin(), text.end(), &reader);
  return std::move(reader).Finish(parsed);
}

}  // namespace pepeseg
