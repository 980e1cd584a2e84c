#include "core/sfm/sfm_photographs.h"

#include <algorithm>
#include <map>
#include <set>
#include <system_error>
#include <tuple>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/base/digest.h"
#include "core/base/file_io.h"
#include "core/base/file_name.h"
#include "core/base/status_macros.h"
#include "core/dataset/companion_files.h"
#include "core/dataset/dataset_index.h"
#include "core/dataset/frame_choice.h"
#include "core/formats/images.h"
#include "core/formats/plain_copy.h"

namespace pepeseg {
namespace {

constexpr size_t kLeastPhotographs = 3;

// A name split for sorting by number: "walk_000123.jpg" is ("walk_", "123"). Digits stay text, so
// that long numbers do not overflow; shorter ones are smaller.
struct NumberedName {
  std::string stem;
  std::string digits;  // without leading zeros

  explicit NumberedName(absl::string_view name) {
    const absl::string_view whole = WithoutSuffix(name);
    size_t end = whole.size();
    while (end > 0 && absl::ascii_isdigit(static_cast<unsigned char>(whole[end - 1]))) --end;
    stem = std::string(whole.substr(0, end));
    digits = std::string(whole.substr(end));
    numbered = !digits.empty();
    digits.erase(0, std::min(digits.find_first_not_of('0'), digits.size()));
  }

  bool numbered = false;
};

// Compares by text in front of the number, then by the number, then by the whole name.
bool GoesBefore(const SfmPhotograph& a, const SfmPhotograph& b) {
  const NumberedName first(a.name), second(b.name);
  return std::tuple(first.stem, first.digits.size(), first.digits, a.name) <
         std::tuple(second.stem, second.digits.size(), second.digits, b.name);
}

// Reads one photograph, except for its ignore masks. The photograph is not decoded.
absl::StatusOr<SfmPhotograph> ReadPhotograph(const DatasetFile& file) {
  RETURN_IF_ERROR(ValidateName(file.name));
  ASSIGN_OR_RETURN(const std::string bytes, ReadFile(file.path, file.name, kMaxImageFileBytes));
  const std::span<const uint8_t> span(reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size());
  SfmPhotograph photograph;
  photograph.name = file.name;
  photograph.path = file.path;
  photograph.camera = ReadExifCamera(span);
  photograph.orientation = ReadExifOrientation(span);
  photograph.sha256 = Sha256Hex(bytes);
  ASSIGN_OR_RETURN(photograph.header, ReadImageHeader(file.name, span));
  return photograph;
}

absl::Status MakeFolder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (!error) return absl::OkStatus();
  return absl::InternalError(absl::StrCat("cannot make ", folder.string(), ": ", error.message()));
}

// Copies a photograph for COLMAP 3.8, which may not read PNGs with 16 bits, a palette or alpha. It
// reads the stored pixels, so that photographs of one sensor share a camera.
absl::Status CopyPhotograph(const SfmPhotograph& photograph, const std::filesystem::path& copy) {
  ASSIGN_OR_RETURN(const std::string bytes,
                   ReadFile(photograph.path, photograph.name, kMaxImageFileBytes));
  ASSIGN_OR_RETURN(const std::string plain,
                   PlainCopy({reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()},
                             photograph.name, {.upright = false, .webp = true}));
  return WriteFileAtomically(copy, plain.empty() ? bytes : plain);
}

// Writes the union of the photograph's ignore masks, with 0 for ignored pixels and 255 for others.
absl::Status WriteMask(const SfmPhotograph& photograph, const std::filesystem::path& path) {
  ASSIGN_OR_RETURN(const std::vector<uint8_t> ignored, IgnoredPixels(photograph));
  Image mask{photograph.header.width, photograph.header.height, 1, {}};
  mask.pixels.reserve(ignored.size());
  for (const uint8_t value : ignored) mask.pixels.push_back(value != 0 ? 0 : 255);
  ASSIGN_OR_RETURN(const std::string png, EncodePng(mask));
  RETURN_IF_ERROR(MakeFolder(path.parent_path()));
  return WriteFileAtomically(path, png);
}

}  // namespace

absl::StatusOr<std::vector<SfmPhotograph>> ReadSfmPhotographs(std::span<const DatasetFile> files) {
  ASSIGN_OR_RETURN(const DatasetIndex index, IndexDataset(files));
  std::vector<SfmPhotograph> photographs;
  photographs.reserve(index.photos.size());
  PhotoFactsByKey facts;
  for (const auto& [key, file] : index.photos) {
    ASSIGN_OR_RETURN(SfmPhotograph photograph, ReadPhotograph(*file));
    if (index.ignore_all != nullptr) photograph.ignore.push_back(*index.ignore_all);
    // Ignore masks belong to a photograph by its name without suffix.
    const auto own = index.ignore.find(std::string(WithoutSuffix(key)));
    if (own != index.ignore.end()) photograph.ignore.push_back(*own->second);
    facts[key] = {photograph.header.width, photograph.header.height, photograph.orientation};
    photographs.push_back(std::move(photograph));
  }
  ASSIGN_OR_RETURN(const CompanionFrames frames,
                   ChooseCompanionFrames(index, facts, {Companion::kIgnore}));
  const auto frame = frames.find(Companion::kIgnore);
  for (SfmPhotograph& photograph : photographs) {
    if (frame != frames.end()) photograph.ignore_frame = frame->second;
  }
  // By number where there is one, because sequential matching relies on the order in which they
  // were taken.
  std::sort(photographs.begin(), photographs.end(), GoesBefore);
  return photographs;
}

absl::Status CheckEnough(std::span<const SfmPhotograph> photographs) {
  // Copies of one photograph give no baseline, so only different bytes count.
  std::set<std::string> different;
  for (const SfmPhotograph& photograph : photographs) different.insert(photograph.sha256);
  if (different.size() >= kLeastPhotographs) return absl::OkStatus();
  std::string count = absl::StrCat(photographs.size(), " photographs");
  if (different.size() < photographs.size()) {
    absl::StrAppend(&count, ", of which only ", different.size(),
                    different.size() == 1 ? " is" : " are", " different");
  }
  constexpr size_t kNamed = 5;
  for (size_t i = 0; i < std::min(photographs.size(), kNamed); ++i) {
    absl::StrAppend(&count, i == 0 ? " (" : ", ", photographs[i].name);
  }
  if (!photographs.empty()) absl::StrAppend(&count, photographs.size() > kNamed ? ", ...)" : ")");
  return absl::FailedPreconditionError(absl::StrCat(
      count, ": poses are estimated from at least ", kLeastPhotographs,
      " different ones; take some 20 to 100 from places all about the scene, or upload poses"));
}

bool AreNumbered(std::span<const SfmPhotograph> photographs) {
  return std::all_of(photographs.begin(), photographs.end(), [](const SfmPhotograph& photograph) {
    return NumberedName(photograph.name).numbered;
  });
}

absl::StatusOr<std::vector<uint8_t>> IgnoredPixels(const SfmPhotograph& photograph) {
  if (photograph.ignore.empty()) return std::vector<uint8_t>();
  const PhotoSize size{photograph.name, photograph.header.width, photograph.header.height};
  DatasetIndex index;
  const std::string stem(WithoutSuffix(PhotoKey(photograph.name)));
  // Which of them is for all photographs makes no difference to their union.
  index.ignore_all = &photograph.ignore.front();
  if (photograph.ignore.size() > 1) index.ignore[stem] = &photograph.ignore.back();
  const CompanionFiles files(index, {{Companion::kIgnore, photograph.ignore_frame}});
  return files.Ignored(stem, {size, photograph.orientation, PixelFrame::kStored});
}

std::vector<size_t> CameraIndices(std::span<const SfmPhotograph> photographs) {
  using Key = std::tuple<int, int, std::string, std::string, double, int>;
  std::map<Key, size_t> cameras;
  std::vector<size_t> indices;
  indices.reserve(photographs.size());
  for (const SfmPhotograph& photograph : photographs) {
    const ExifCamera& exif = photograph.camera;
    const Key key(photograph.header.width, photograph.header.height, exif.maker, exif.model,
                  exif.focal_length, exif.focal_length_35_mm);
    indices.push_back(cameras.try_emplace(key, cameras.size()).first->second);
  }
  return indices;
}

std::vector<std::string> SafeNames(std::span<const SfmPhotograph> photographs) {
  const std::vector<size_t> cameras = CameraIndices(photographs);
  std::vector<std::string> names;
  names.reserve(photographs.size());
  for (size_t i = 0; i < photographs.size(); ++i) {
    // A folder for each camera: COLMAP is run with single_camera_per_folder.
    names.push_back(absl::StrFormat("c%d/%06d%s", cameras[i] + 1, i + 1,
                                    SuffixOf(photographs[i].header.format)));
  }
  return names;
}

absl::StatusOr<bool> LayOut(std::span<const SfmPhotograph> photographs,
                            const std::filesystem::path& images,
                            const std::filesystem::path& masks) {
  bool any_mask = false;
  const std::vector<std::string> names = SafeNames(photographs);
  for (size_t i = 0; i < photographs.size(); ++i) {
    const std::filesystem::path copy = images / names[i];
    RETURN_IF_ERROR(MakeFolder(copy.parent_path()));
    RETURN_IF_ERROR(CopyPhotograph(photographs[i], copy));
    if (photographs[i].ignore.empty()) continue;
    // COLMAP finds a mask by the photograph's whole name with ".png" appended.
    RETURN_IF_ERROR(WriteMask(photographs[i], masks / (names[i] + ".png")));
    any_mask = true;
  }
  return any_mask;
}

}  // namespace pepeseg
