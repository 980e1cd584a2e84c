// Uploads through the server program, killed in the middle of them.
#include <gtest/gtest.h>

#include <cstring>
#include <fstream>
#include <sstream>
#include <thread>

#include "absl/time/clock.h"
#include "core/io/digest.h"
#include "server/layout.h"
#include "tests/server/pepesegd_process.h"
#include "tests/server/service_client.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

using testing::ClientFile;
using testing::PepesegdProcess;
using testing::ServiceClient;

constexpr int64_t kMiB = int64_t{1} << 20;

// No piece of it is like another.
std::string ManyBytes(int64_t size) {
  std::string bytes(static_cast<size_t>(size), '\0');
  uint64_t state = 88172645463325252ull;
  for (size_t i = 0; i + 8 <= bytes.size(); i += 8) {
    state ^= state << 13;
    state ^= state >> 7;
    state ^= state << 17;
    std::memcpy(&bytes[i], &state, 8);
  }
  return bytes;
}

int64_t CommittedBytes(const v1::Upload& upload) {
  return upload.partial_files().empty() ? 0 : upload.partial_files(0).committed_bytes();
}

TEST(UploadKill, GoesOnWithLessThan33MiBSentAgain) {
  const testing::TempFolder folder;
  const ClientFile file{"videos/walk.mp4", v1::FILE_KIND_VIDEO, ManyBytes(100 * kMiB)};
  auto server = std::make_unique<PepesegdProcess>(folder / "data");
  auto client = std::make_unique<ServiceClient>(server->channel());
  ASSERT_OK(client->CreateScene("shelf"));
  ASSERT_OK_AND_ASSIGN(v1::Upload upload, client->CreateUpload("shelf", {file}));
  // Sent up to there, and killed as soon as the server has it.
  int64_t offset = 0;
  for (const int64_t target : {20 * kMiB, 45 * kMiB, 90 * kMiB}) {
    const auto partial =
        PartialFolderOf(folder / "data", {"default", "shelf", 1}) / Sha256Hex(file.bytes);
    std::thread killer([&] {
      const absl::Time deadline = absl::Now() + absl::Seconds(60);
      std::error_code error;
      while (absl::Now() < deadline) {
        const auto size = std::filesystem::file_size(partial, error);
        if (!error && static_cast<int64_t>(size) >= target) break;
        absl::SleepFor(absl::Milliseconds(1));
      }
      server->Kill();
    });
    EXPECT_FALSE(client->SendFrom(upload, file, {offset, target}).ok());
    killer.join();
    server = std::make_unique<PepesegdProcess>(folder / "data");
    client = std::make_unique<ServiceClient>(server->channel());
    ASSERT_OK_AND_ASSIGN(upload, client->GetUpload(upload.name()));
    offset = CommittedBytes(upload);
    EXPECT_LE(offset, target);
    EXPECT_LT(target - offset, 33 * kMiB) << "is sent again";
    std::ifstream there(partial, std::ios::binary);
    std::string bytes(static_cast<size_t>(offset), '\0');
    there.read(bytes.data(), offset);
    EXPECT_TRUE(there && bytes == file.bytes.substr(0, static_cast<size_t>(offset)));
  }
  EXPECT_GE(offset, 64 * kMiB);
  ASSERT_OK(client->SendFrom(upload, file, {offset, 100 * kMiB}));
  ASSERT_OK(client->SealUpload(upload.name()));
  std::ostringstream stored;
  stored << std::ifstream(BlobPath(folder / "data", {"default", Sha256Hex(file.bytes)}),
                          std::ios::binary)
                .rdbuf();
  EXPECT_EQ(Sha256Hex(stored.str()), Sha256Hex(file.bytes));
}

}  // namespace
}  // namespace pepeseg
