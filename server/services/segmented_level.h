#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/query/decomposition.h"
#include "server/services/annotated_views.h"
#include "server/services/segment_answer.h"

namespace pepeseg {

// All segments of a level of a decomposition as things. Each part is a view.
class SegmentedLevel final : public AnnotatedViews {
 public:
  // Loads the model and decomposes it, which takes long the first time. `request` must have
  // segments. INVALID_ARGUMENT: there is no such level, or the request has labels or sam_borders.
  static absl::StatusOr<std::unique_ptr<AnnotatedViews>> Begin(
      const SegmentTools& tools, const QueryCall& call,
      const v1::ExportAnnotationsRequest& request);

  absl::StatusOr<bool> FindSome() override;
  bool done() const override { return next_view_ == scene_.views.size(); }
  absl::StatusOr<ThingGaussians> GaussiansOf(size_t thing) const override;

 private:
  SegmentedLevel() = default;
  absl::Status Decompose();
  // Renders the ids of the segments in a view.
  absl::StatusOr<RenderedView> Render(const ModelView& view, FrameKind frame) const;
  // Returns the texts of the labels that fit each segment best.
  absl::StatusOr<std::vector<std::string>> NamesOfSegments(Store& store,
                                                           const WantedCheck& check) const;

  std::vector<double> scales_;
  int level_ = 0;
  std::vector<Decomposition::Segment> segments_;
  size_t next_view_ = 0;
};

}  // namespace pepeseg
