#include "tests/server/service_test.h"

namespace pepeseg {

v1::Job ServiceTest::TrainToTheEnd(const std::string& scene, const std::string& file) {
  const v1::Job job = running.Await(running.Train(scene, file).name());
  EXPECT_EQ(job.state(), v1::JOB_STATE_SUCCEEDED) << job.DebugString();
  return job;
}

}  // namespace pepeseg
