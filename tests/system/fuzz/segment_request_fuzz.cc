#include <utility>

#include "server/api/segment_request.h"
#include "tests/system/fuzz/fuzz_message.h"
#include "tests/system/fuzz/small_model.h"

// A request that is accepted is answered, or refused by the model with a reason.
PEPESEG_FUZZ_MESSAGE(segment_request, pepeseg::v1::SegmentViewsRequest) {
  static pepeseg::fuzz::SmallModel small;
  auto asked = small.reader().Read(message);
  if (!asked.ok()) return;
  // Free cameras of any size are for the answer's limits to refuse.
  if (asked->prompt.view.camera.width > 64 || asked->prompt.view.camera.height > 64) return;
  if (asked->targets.size() > 2) return;
  asked->options = {.want_similarity = true, .refine_borders = true};
  size_t num_masks = 0;
  const size_t num_targets = asked->targets.size();
  auto views = small.model().Segment(*std::move(asked), [] { return absl::OkStatus(); });
  if (!views.ok()) return;
  for (; !views->done(); ++num_masks) {
    if (!views->Next().ok()) return;
  }
  pepeseg::fuzz::Expect(num_masks == num_targets, "a mask for each view");
}
