#include "core/sfm/mapper/check_arguments.h"

#include <vector>

#include "absl/strings/str_cat.h"

namespace pepeseg {

absl::Status CheckMapperArguments(std::span<const MapperPhotograph> photographs,
                                  std::span<const VerifiedPair> pairs) {
  std::vector<const MapperPhotograph*> first_of;
  for (const MapperPhotograph& photograph : photographs) {
    if (photograph.camera_group < 0 || photograph.width <= 0 || photograph.height <= 0) {
      return absl::InvalidArgumentError(
          absl::StrCat("photograph \"", photograph.name, "\": no size or camera group"));
    }
    const auto group = static_cast<size_t>(photograph.camera_group);
    if (group >= photographs.size()) {
      return absl::InvalidArgumentError(absl::StrCat("photograph \"", photograph.name,
                                                     "\": camera group ", group, " of at most ",
                                                     photographs.size()));
    }
    if (first_of.size() <= group) first_of.resize(group + 1);
    if (!first_of[group]) first_of[group] = &photograph;
    if (first_of[group]->width != photograph.width ||
        first_of[group]->height != photograph.height) {
      return absl::InvalidArgumentError(absl::StrCat("photographs \"", first_of[group]->name,
                                                     "\" and \"", photograph.name,
                                                     "\" of one camera group differ in size"));
    }
  }
  for (const VerifiedPair& pair : pairs) {
    if (pair.first >= photographs.size() || pair.second >= photographs.size() ||
        pair.first == pair.second) {
      return absl::InvalidArgumentError(absl::StrCat("pair of photographs ", pair.first, " and ",
                                                     pair.second, ", there are ",
                                                     photographs.size()));
    }
    for (const FeatureMatch& match : pair.geometry.inliers) {
      if (match.first >= photographs[pair.first].keypoints.size() ||
          match.second >= photographs[pair.second].keypoints.size()) {
        return absl::InvalidArgumentError(absl::StrCat("a match of photographs ", pair.first,
                                                       " and ", pair.second,
                                                       " names a feature that they do not have"));
      }
    }
  }
  return absl::OkStatus();
}

}  // namespace pepeseg
