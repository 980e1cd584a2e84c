// SIGTERM while a thread of the server program hangs forever. The process must still end.
#include <gtest/gtest.h>

#include <future>
#include <string>
#include <vector>

#include "absl/strings/match.h"
#include "absl/time/clock.h"
#include "tests/server/pepesegd_process.h"
#include "tests/server/service_client.h"
#include "tests/system/stress/io_fault_lives.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"
#include "tests/testing/time_limit.h"

namespace pepeseg {
namespace {

TEST(StopDeadline, EndsAProcessWhoseDiskHangs) {
  const testing::TempFolder folder;
  std::vector<std::string> environment = FaultEnvironment(folder / "data", "hang:1");
  environment.push_back("PEPESEG_FAULT_FILE=/blobs/");
  // PepesegdProcess gives --grace=5.
  testing::PepesegdProcess server(folder / "data",
                                  {{}, std::move(environment), PEPESEG_MODEL_WORKER, "", false});
  testing::ServiceClient client(server.channel());
  ASSERT_OK(client.CreateScene("a"));
  const std::vector<testing::ClientFile> files = {{"1.jpg", v1::FILE_KIND_IMAGE, "bytes"}};
  const auto upload = client.CreateUpload("a", files);
  ASSERT_OK(upload);
  auto written = std::async(std::launch::async, [&] { return client.WriteFiles(*upload, files); });
  ASSERT_EQ(written.wait_for(std::chrono::seconds(2)), std::future_status::timeout);
  const absl::Time start = absl::Now();
  const auto end = server.Terminate();
  const absl::Duration took = absl::Now() - start;
  ASSERT_TRUE(end.has_value()) << server.Log();
  EXPECT_EQ(end->exit_code, 1) << end->description;
  EXPECT_LT(took, testing::TimeLimit(absl::Seconds(8)));
  EXPECT_TRUE(absl::StrContains(server.Log(), "not stopped in time")) << server.Log();
  EXPECT_FALSE(written.get().ok());
}

}  // namespace
}  // namespace pepeseg
