#include <cmath>

#include "server/api/segment_request.h"
#include "tests/system/fuzz/fuzz_message.h"
#include "tests/system/fuzz/small_model.h"

PEPESEG_FUZZ_MESSAGE(propose_request, pepeseg::v1::ProposeScalesRequest) {
  static pepeseg::fuzz::SmallModel small;
  const auto query = small.reader().Read(message);
  if (!query.ok() || query->view.camera.width > 64 || query->view.camera.height > 64) {
    return;
  }
  pepeseg::fuzz::Expect(query->max_proposals > 0, "a number of proposals");
  for (const pepeseg::PointPrompt& point : query->points) {
    pepeseg::fuzz::Expect(std::isfinite(point.x) && std::isfinite(point.y), "finite points");
  }
}
