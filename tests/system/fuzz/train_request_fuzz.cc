#include "core/features/estimate.h"
#include "core/reconstruct/estimate.h"
#include "core/render/renderer.h"
#include "pepeseg/v1/job_service.pb.h"
#include "server/api/convert.h"
#include "server/api/resource_name.h"
#include "tests/system/fuzz/fuzz_message.h"

// Options that are accepted are accepted again as the job stores them, and can be estimated.
PEPESEG_FUZZ_MESSAGE(train_request, pepeseg::v1::TrainSceneRequest) {
  using pepeseg::fuzz::Expect;
  (void)pepeseg::SplitSceneName(message.scene());
  (void)pepeseg::SplitSceneName(message.dataset());
  const auto settings = pepeseg::TrainingSettingsFromProto(message.options());
  if (!settings.ok()) return;
  const auto stored = pepeseg::ToProto(*settings);
  const auto again = pepeseg::TrainingSettingsFromProto(stored);
  Expect(again.ok(), "effective options to be valid");
  Expect(pepeseg::ToProto(*again).DebugString() == stored.DebugString(), "the same options again");
  // The estimate is for the largest dataset that can be uploaded.
  const pepeseg::TrainingSize size{10'000, 10'000, int64_t{640} << 30, 64'000'000, 50'000'000};
  const int64_t count = pepeseg::MostGaussians(size, settings->reconstruct);
  Expect(count >= 0, "a number of Gaussians");
  const pepeseg::ScratchSize scratch = pepeseg::TypicalScratch(count, size.max_pixels);
  Expect(pepeseg::FeatureHostBytes(scratch, 3, settings->features) >= 0, "a number of bytes");
}
