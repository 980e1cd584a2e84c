#include "server/services/subset_lookup.h"

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/api/error.h"
#include "server/services/segment_lookup.h"
#include "server/services/selection_lookup.h"

namespace pepeseg {

absl::StatusOr<std::optional<GaussianSet>> FindSubset(const ServiceContext& context,
                                                      const ResidentModel& model,
                                                      const v1::Subset& subset,
                                                      const std::string& field) {
  GaussianSet found;
  switch (subset.of_case()) {
    case v1::Subset::kSelection: {
      ASSIGN_OR_RETURN(found,
                       FindSelection(context, subset.selection(), model.row, field + ".selection"));
      break;
    }
    case v1::Subset::kSegment: {
      RETURN_IF_ERROR(CheckFeatures(model));
      ASSIGN_OR_RETURN(found, FindSegment(*model.segmenter, subset.segment(), field + ".segment"));
      break;
    }
    default:
      if (!subset.complement()) return std::nullopt;
      return BadField(field + ".complement", "true", "of neither a selection nor a segment");
  }
  if (subset.complement()) {
    for (uint8_t& member : found.member) member = member != 0 ? 0 : 1;
  }
  return found;
}

}  // namespace pepeseg
