#include "server/api/segment_request.h"
#include "tests/system/fuzz/fuzz_message.h"
#include "tests/system/fuzz/small_model.h"

PEPESEG_FUZZ_MESSAGE(propose_request, pepeseg::v1::ProposeScalesRequest) {
  static pepeseg::fuzz::SmallModel small;
  const auto asked = small.reader().Read(message);
  if (!asked.ok()) return;
  const pepeseg::Camera& camera = asked->prompt.view.camera;
  if (camera.width > 64 || camera.height > 64) return;
  pepeseg::fuzz::Expect(asked->max_count > 0, "a number of proposals");
  const auto proposals = small.model().Propose(*asked);
  if (!proposals.ok()) return;
  pepeseg::fuzz::Expect(proposals->masks.size() == proposals->candidates.list.size(),
                        "a mask for each candidate");
}
