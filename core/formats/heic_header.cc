#include "core/formats/heic_header.h"

#include <algorithm>
#include <array>
#include <optional>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

using HeicBytes = std::span<const uint8_t>;

absl::Status MalformedHeic(absl::string_view why) {
  return absl::InvalidArgumentError(absl::StrCat("malformed HEIC file: ", why));
}

// Reads big-endian numbers from the front of a box. A number beyond its end is 0 and sets
// overrun().
class BoxReader {
 public:
  explicit BoxReader(HeicBytes bytes) : bytes_(bytes) {}

  uint64_t Number(size_t num_bytes) {
    if (bytes_.size() < num_bytes) {
      bytes_ = {};
      overrun_ = true;
      return 0;
    }
    uint64_t value = 0;
    for (size_t i = 0; i < num_bytes; ++i) value = value << 8 | bytes_[i];
    bytes_ = bytes_.subspan(num_bytes);
    return value;
  }
  HeicBytes rest() const { return bytes_; }
  bool overrun() const { return overrun_; }

 private:
  HeicBytes bytes_;
  bool overrun_ = false;
};

// A box of ISO/IEC 14496-12: a 32-bit length that includes itself, a type of four letters, the
// body. Length 1: a 64-bit length follows the type. Length 0: the box reaches to the end of the
// file.
struct Box {
  std::string type;
  HeicBytes body;
  bool is_whole = true;  // false: the bytes end before the box does
};

// Removes the box at the front of `bytes` and returns it, or nothing if no valid box follows.
std::optional<Box> TakeBox(HeicBytes& bytes) {
  if (bytes.size() < 8) return std::nullopt;
  BoxReader reader(bytes);
  uint64_t length = reader.Number(4);  // of the whole box
  Box box;
  box.type = std::string(bytes.begin() + 4, bytes.begin() + 8);
  reader.Number(4);
  if (length == 1) length = reader.Number(8);
  if (length == 0) length = bytes.size();
  const size_t head = bytes.size() - reader.rest().size();
  if (reader.overrun() || length < head) return std::nullopt;
  box.is_whole = length <= bytes.size();
  // A length beyond the end is clamped: the caller may have only the front of a file.
  const size_t size = std::min<uint64_t>(length, bytes.size());
  box.body = bytes.subspan(head, size - head);
  bytes = bytes.subspan(size);
  return box;
}

// Returns the body of the first whole box of that type.
std::optional<HeicBytes> FindBox(HeicBytes bytes, absl::string_view type) {
  while (const std::optional<Box> box = TakeBox(bytes)) {
    if (box->type == type && box->is_whole) return box->body;
  }
  return std::nullopt;
}

// Returns the version of a "full box", whose body begins with a version and flags.
uint64_t VersionOf(HeicBytes body) { return body.empty() ? 0 : body[0]; }

// Returns the id of the primary item, from the body of the "pitm" box.
uint64_t PrimaryItem(HeicBytes pitm) {
  BoxReader reader(pitm);
  const bool is_long = VersionOf(pitm) > 0;
  reader.Number(4);
  return reader.Number(is_long ? 4 : 2);
}

// Returns the indices, from 1, of the item's properties, in the order in which they apply. `ipma`
// is the body of the box that associates items with properties.
std::vector<size_t> PropertiesOf(HeicBytes ipma, uint64_t item) {
  BoxReader reader(ipma);
  const uint64_t version = VersionOf(ipma);
  const uint64_t flags = reader.Number(4) & 0xffffff;
  // ISO/IEC 23008-12: flag 1 makes the indices 15 bits instead of 7; the bit above marks essential
  // properties.
  const size_t index_bytes = (flags & 1) != 0 ? 2 : 1;
  const uint64_t essential = uint64_t{1} << (8 * index_bytes - 1);
  std::vector<size_t> found;
  for (uint64_t left = reader.Number(4); left > 0 && !reader.overrun(); --left) {
    const uint64_t owner = reader.Number(version > 0 ? 4 : 2);
    for (uint64_t i = reader.Number(1); i > 0 && !reader.overrun(); --i) {
      const uint64_t index = reader.Number(index_bytes) & ~essential;
      if (owner == item) found.push_back(static_cast<size_t>(index));
    }
  }
  return found;
}

// Applies a property to the size: "ispe" sets it, "irot" by a quarter turn swaps the sides, "clap"
// (clean aperture) crops it to a size given in fractions.
void Apply(const Box& property, HeicSize& size) {
  BoxReader reader(property.body);
  if (property.type == "ispe") {
    reader.Number(4);
    size.width = reader.Number(4);
    size.height = reader.Number(4);
  } else if (property.type == "irot") {
    if (reader.Number(1) % 2 == 1) std::swap(size.width, size.height);
  } else if (property.type == "clap") {
    const uint64_t width = reader.Number(4), width_parts = reader.Number(4);
    const uint64_t height = reader.Number(4), height_parts = reader.Number(4);
    if (width_parts == 0 || height_parts == 0) return;
    // Rounded to the nearest pixel; a crop never enlarges.
    size.width = std::min(size.width, (width + width_parts / 2) / width_parts);
    size.height = std::min(size.height, (height + height_parts / 2) / height_parts);
  }
}

}  // namespace

// The first box is "ftyp", whose body begins with the major brand.
bool IsHeic(HeicBytes bytes) {
  constexpr std::array<absl::string_view, 7> kBrands = {"heic", "heix", "heim", "heis",
                                                        "hevc", "mif1", "msf1"};
  if (bytes.size() < 12) return false;
  const absl::string_view text(reinterpret_cast<const char*>(bytes.data()), 12);
  return text.substr(4, 4) == "ftyp" &&
         std::find(kBrands.begin(), kBrands.end(), text.substr(8, 4)) != kBrands.end();
}

absl::StatusOr<HeicSize> ReadHeicSize(HeicBytes bytes) {
  const std::optional<HeicBytes> meta = FindBox(bytes, "meta");
  if (!meta || meta->size() < 4) {
    return absl::InvalidArgumentError("the HEIC file's header is cut short");
  }
  const HeicBytes boxes = meta->subspan(4);  // after version and flags
  const std::optional<HeicBytes> primary = FindBox(boxes, "pitm");
  const std::optional<HeicBytes> properties = FindBox(boxes, "iprp");
  if (!primary || !properties) return MalformedHeic("it names no picture");
  const std::optional<HeicBytes> container = FindBox(*properties, "ipco");
  const std::optional<HeicBytes> associations = FindBox(*properties, "ipma");
  if (!container || !associations) return MalformedHeic("its picture has no properties");
  std::vector<Box> all;
  HeicBytes rest = *container;
  while (std::optional<Box> box = TakeBox(rest)) all.push_back(*std::move(box));
  HeicSize size;
  // Properties apply in their order: a rotation after a crop swaps the cropped sides.
  for (const size_t index : PropertiesOf(*associations, PrimaryItem(*primary))) {
    if (index >= 1 && index <= all.size()) Apply(all[index - 1], size);
  }
  if (size.width == 0 || size.height == 0) return MalformedHeic("its picture has no size");
  return size;
}

absl::Status CheckHeicIsWhole(HeicBytes file) {
  while (!file.empty()) {
    const std::optional<Box> box = TakeBox(file);
    if (!box || !box->is_whole) return absl::InvalidArgumentError("the HEIC file is cut short");
  }
  return absl::OkStatus();
}

}  // namespace pepeseg
