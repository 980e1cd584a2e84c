#include <cmath>

#include "core/prompt/propose_scales.h"
#include "server/services/segment_question.h"
#include "tests/system/fuzz/fuzz_message.h"
#include "tests/system/fuzz/small_model.h"

PEPESEG_FUZZ_MESSAGE(propose_request, pepeseg::v1::ProposeScalesRequest) {
  static pepeseg::fuzz::SmallModel small;
  const auto question = pepeseg::ReadQuestion(small.context(), small.resident(), message);
  if (!question.ok() || question->view.camera.width > 64 || question->view.camera.height > 64) {
    return;
  }
  pepeseg::fuzz::Expect(question->max_proposals > 0, "a number of proposals");
  for (const pepeseg::PointPrompt& point : question->points) {
    pepeseg::fuzz::Expect(std::isfinite(point.x) && std::isfinite(point.y), "finite points");
  }
}
