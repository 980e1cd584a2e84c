#include "server/api/decomposition.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/api/convert.h"
#include "server/api/error.h"

namespace pepeseg {

absl::StatusOr<std::vector<double>> ReadScales(
    const google::protobuf::RepeatedField<double>& scales, const std::string& field) {
  if (scales.empty()) {
    return std::vector<double>(kDefaultDecompositionScales.begin(),
                               kDefaultDecompositionScales.end());
  }
  std::vector<double> read(scales.begin(), scales.end());
  RETURN_IF_ERROR(AtField(CheckDecompositionScales(read), field));
  return read;
}

absl::Status CheckLevelField(int32_t level, size_t num_levels, const std::string& field) {
  if (level >= 0 && static_cast<size_t>(level) < num_levels) return absl::OkStatus();
  return BadField(field, absl::StrCat(level),
                  absl::StrCat("no level of ", num_levels, ", which are counted from 0"));
}

absl::StatusOr<GaussianSet> FindSegment(const SceneModel& model, const v1::SegmentRef& segment,
                                        const std::string& field) {
  ASSIGN_OR_RETURN(const std::vector<double> scales,
                   ReadScales(segment.scales(), field + ".scales"));
  RETURN_IF_ERROR(CheckLevelField(segment.level(), scales.size(), field + ".level"));
  GaussianSet found;
  // The members are copied out, since the decomposition lives only for this call.
  const auto find = [&](const Decomposition& whole) -> absl::Status {
    const size_t num_segments = whole.levels[segment.level()].segments.size();
    if (segment.id() < 1 || static_cast<size_t>(segment.id()) > num_segments) {
      return BadField(field + ".id", absl::StrCat(segment.id()),
                      absl::StrCat("no segment; level ", segment.level(), " has ", num_segments,
                                   ", which are counted from 1"));
    }
    ASSIGN_OR_RETURN(found, MembersOf(whole, segment.level(), segment.id()));
    return absl::OkStatus();
  };
  RETURN_IF_ERROR(model.Decompose(scales, find));
  return found;
}

absl::StatusOr<std::vector<std::vector<int32_t>>> FindSegmentIds(
    const SceneModel& model, const google::protobuf::RepeatedField<double>& scales,
    const std::string& field) {
  ASSIGN_OR_RETURN(const std::vector<double> read, ReadScales(scales, field));
  std::vector<std::vector<int32_t>> ids;
  // Copied out, as in FindSegment.
  RETURN_IF_ERROR(model.Decompose(read, [&](const Decomposition& whole) {
    for (const Decomposition::Level& level : whole.levels) ids.push_back(level.ids);
    return absl::OkStatus();
  }));
  return ids;
}

v1::DecomposeModelResponse::Level LevelToProto(const Decomposition::Level& level,
                                               const Model& model) {
  v1::DecomposeModelResponse::Level proto;
  proto.set_scale_quantile(level.scale);
  proto.set_scale_units(ScaleOfQuantile(model.field, level.scale));
  proto.set_num_unassigned(std::count(level.ids.begin(), level.ids.end(), 0));
  for (const Decomposition::Segment& segment : level.segments) {
    v1::DecomposeModelResponse::Segment& to = *proto.add_segments();
    // Ids count from 1; 0 stands for Gaussians without a segment.
    to.set_id(proto.segments_size());
    to.set_parent(segment.parent);
    to.set_num_gaussians(segment.num_gaussians);
    const auto& min = segment.min;
    const auto& max = segment.max;
    *to.mutable_box()->mutable_min() = VectorToProto({min[0], min[1], min[2]});
    *to.mutable_box()->mutable_max() = VectorToProto({max[0], max[1], max[2]});
  }
  return proto;
}

}  // namespace pepeseg
