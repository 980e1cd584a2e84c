// Out of memory on the device, memory returned to it, and memory of twins.
#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "kernels/buffer.h"
#include "tests/kernels/backend_test.h"

namespace pepeseg {
namespace {

class CudaMemoryTest : public CudaAndCpuTest {};

TEST_F(CudaMemoryTest, ClearsAnOutOfMemoryErrorOnceTaken) {
  const std::vector<float> values = {1, 2, 3};
  const Buffer<float> before(*cuda_, std::span<const float>(values));
  const size_t in_use = cuda_->bytes_in_use();
  Buffer<float> reused(*cuda_, 10);
  for (int i = 0; i < 3; ++i) {
    // As floats this is twice the memory of the device.
    EXPECT_FALSE(reused.Reserve(*cuda_, cuda_->memory().total_bytes / 2));
    EXPECT_TRUE(reused.empty());
    EXPECT_NE(cuda_->error().find("out of memory"), std::string::npos) << cuda_->error();
    EXPECT_TRUE(Buffer<float>(*cuda_, 10).empty())
        << "nothing is allocated until the error is taken";
    const BackendError error = cuda_->TakeError();
    EXPECT_NE(error.what.find("out of memory"), std::string::npos) << error.what;
    EXPECT_FALSE(error.fatal);
    EXPECT_EQ(cuda_->TakeError().what, "");
    EXPECT_EQ(cuda_->bytes_in_use(), in_use);
    std::vector<float> read(values.size());
    before.Download(read);
    EXPECT_EQ(read, values);
    ASSERT_TRUE(reused.Reserve(*cuda_, 10));
    reused = {};
  }
}

TEST_F(CudaMemoryTest, ReleasesFreedMemoryToTheDevice) {
  const int64_t size = int64_t{1} << 28;
  const Buffer<float> kept(*cuda_, 1000);
  EXPECT_FALSE(Buffer<float>(*cuda_, size).empty());  // freed at once
  cuda_->ReleaseFreed();
  EXPECT_EQ(cuda_->error(), "");
  EXPECT_FALSE(Buffer<float>(*cuda_, size).empty());
}

TEST_F(CudaMemoryTest, CountsThatOfTwins) {
  const std::vector<float> values = {1, 2, 3};
  const Buffer<float> own(*cuda_, std::span<const float>(values));
  const size_t in_use = cuda_->bytes_in_use();
  for (const QueuePriority priority : {QueuePriority::kSame, QueuePriority::kFirst}) {
    const auto twin = cuda_->MakeTwin(priority);
    ASSERT_NE(twin, nullptr);
    EXPECT_EQ(twin->bytes_in_use(), in_use);
    {
      const Buffer<float> of_twin(*twin, std::span<const float>(values));
      EXPECT_EQ(cuda_->bytes_in_use(), in_use + values.size() * sizeof(float));
      EXPECT_EQ(twin->bytes_in_use(), cuda_->bytes_in_use());
      std::vector<float> read(values.size());
      of_twin.Download(read);
      EXPECT_EQ(read, values);
      EXPECT_EQ(twin->error(), "");
    }
    EXPECT_EQ(cuda_->bytes_in_use(), in_use);
  }
}

TEST_F(CudaMemoryTest, KeepsErrorsOfTwinsApart) {
  const auto twin = cuda_->MakeTwin(QueuePriority::kFirst);
  ASSERT_NE(twin, nullptr);
  Buffer<float> too_large;
  EXPECT_FALSE(too_large.Reserve(*twin, twin->memory().total_bytes / 2));
  EXPECT_NE(twin->error(), "");
  EXPECT_EQ(cuda_->error(), "");
}

}  // namespace
}  // namespace pepeseg
