#pragma once

#include "core/dataset/view_warp.h"
#include "core/scene/model.h"
#include "tests/testing/status_testing.h"

namespace pepeseg::testing {

// Returns a view of a photograph with this lens, scaled and warped as an upload is.
inline ModelView WarpedView(const Lens& lens, double image_scale, int orientation = 1) {
  const absl::StatusOr<ViewWarp> warp = ViewWarp::Create(lens, image_scale);
  EXPECT_OK(warp.status());
  ModelView view;
  view.camera = warp->camera();
  view.photograph = warp->photograph();
  view.photograph->orientation = orientation;
  return view;
}

}  // namespace pepeseg::testing
