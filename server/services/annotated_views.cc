#include "server/services/annotated_views.h"

#include <algorithm>

#include "core/base/status_macros.h"
#include "core/query/frame.h"
#include "server/api/segment_request.h"

namespace pepeseg {

absl::Status AnnotatedViews::ReadViews(const v1::ExportAnnotationsRequest& request) {
  ASSIGN_OR_RETURN(std::vector<ModelView> views, FindTargets(request.targets(), model_->model()));
  if (views.empty()) views = model_->model().views;
  for (const ModelView& view : views) {
    scene_.views.push_back(view.name);
    const Frame frame(view);
    max_pixels_ = std::max({max_pixels_, int64_t{frame.width()} * frame.height(),
                            int64_t{view.camera.width} * view.camera.height});
  }
  return absl::OkStatus();
}

}  // namespace pepeseg
