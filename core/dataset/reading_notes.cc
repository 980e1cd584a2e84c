#include "core/dataset/reading_notes.h"

#include "absl/strings/str_cat.h"
#include "core/dataset/match_poses.h"

namespace pepeseg {
namespace {

using Names = std::set<std::string>;

const char* NameOf(Companion kind) {
  switch (kind) {
    case Companion::kMasks:
      return "mask files";
    case Companion::kIgnore:
      return "ignore masks";
    case Companion::kDepth:
      return "depth maps";
  }
  return "";
}

std::vector<std::string> Listed(const Names& names) { return {names.begin(), names.end()}; }

}  // namespace

void ReadingNotes::Merge(ReadingNotes other) {
  without_depth.merge(other.without_depth);
  soft.merge(other.soft);
  with_void.merge(other.with_void);
  for (auto& [what, names] : other.of_turned_photos) of_turned_photos[what].merge(names);
  num_resized += other.num_resized;
  turned.merge(other.turned);
}

void ReadingNotes::AddWarnings(std::vector<std::string>& warnings) const {
  if (!without_depth.empty()) {
    warnings.push_back(
        LeftOut(Listed(without_depth), "depth maps have one value everywhere, or none"));
  }
  if (!soft.empty()) {
    warnings.push_back(absl::StrCat(
        soft.size(), " label images are one mask with soft borders each, cut at half of the ",
        "value: ", FirstNames(Listed(soft))));
  }
  if (!with_void.empty()) {
    warnings.push_back(
        absl::StrCat(with_void.size(),
                     " label images have borders of the value 255, which are void and in no mask: ",
                     FirstNames(Listed(with_void))));
  }
  for (const auto& [what, names] : of_turned_photos) {
    warnings.push_back(absl::StrCat(
        names.size(), " ", NameOf(what.first), " of photographs with an EXIF orientation are of ",
        pepeseg::NameOf(what.second), " pixels, and are read so: ", FirstNames(Listed(names))));
  }
  if (num_resized > 0) {
    warnings.push_back(absl::StrCat(num_resized,
                                    " photographs have another size than their cameras, which "
                                    "were scaled to fit"));
  }
  if (!turned.empty()) {
    warnings.push_back(absl::StrCat(
        turned.size(), " photographs are turned by their EXIF orientation, because their ",
        "cameras are of the upright pixels: ", FirstNames(Listed(turned))));
  }
}

}  // namespace pepeseg
