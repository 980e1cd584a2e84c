// The server program is killed in the middle of uploads.
#include <gtest/gtest.h>

#include <cstring>
#include <fstream>
#include <set>
#include <sstream>
#include <thread>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/digest.h"
#include "server/store/layout.h"
#include "tests/server/pepesegd_process.h"
#include "tests/server/service_client.h"
#include "tests/testing/eventually.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

using testing::ClientFile;
using testing::PepesegdProcess;
using testing::ServiceClient;

constexpr int64_t kMiB = int64_t{1} << 20;

// Returns bytes of which no two pieces are equal.
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

TEST(UploadKill, ResumesWithLessThan33MiBSentAgain) {
  const testing::TempFolder folder;
  const ClientFile file{"videos/walk.mp4", v1::FILE_KIND_VIDEO, ManyBytes(100 * kMiB)};
  auto server = std::make_unique<PepesegdProcess>(folder / "data");
  auto client = std::make_unique<ServiceClient>(server->channel());
  ASSERT_OK(client->CreateScene("shelf"));
  ASSERT_OK_AND_ASSIGN(v1::Upload upload, client->CreateUpload("shelf", {file}));
  // Sends the bytes up to there, and kills the server as soon as it has them.
  int64_t offset = 0;
  for (const int64_t target : {20 * kMiB, 45 * kMiB, 90 * kMiB}) {
    const auto partial =
        PartialFolderOf(folder / "data", {{1, "default", "shelf"}, 1}) / Sha256Hex(file.bytes);
    std::thread killer([&] {
      EXPECT_TRUE(testing::Eventually([&] {
        std::error_code error;
        const auto size = std::filesystem::file_size(partial, error);
        return !error && static_cast<int64_t>(size) >= target;
      }));
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

std::vector<ClientFile> TinyFiles(const std::string& name, int num_files) {
  std::vector<ClientFile> files;
  files.reserve(num_files);
  for (int i = 0; i < num_files; ++i) {
    const std::string path = absl::StrCat("images/", name, 10'000 + i, ".jpg");
    files.push_back({path, v1::FILE_KIND_IMAGE, "bytes of " + path});
  }
  return files;
}

// Checks that the files which the server reports as uploaded are stored with the right bytes.
void ExpectStored(const std::filesystem::path& data, const v1::Upload& upload,
                  const std::vector<ClientFile>& files) {
  const std::set<std::string> missing(upload.missing_files().begin(), upload.missing_files().end());
  for (const ClientFile& file : files) {
    if (missing.contains(file.path)) continue;
    std::ostringstream stored;
    stored << std::ifstream(BlobPath(data, {"default", Sha256Hex(file.bytes)}), std::ios::binary)
                  .rdbuf();
    EXPECT_EQ(stored.str(), file.bytes) << file.path;
  }
}

TEST(UploadKill, KeepsAcknowledgedFilesOfAGroup) {
  const testing::TempFolder folder;
  const std::filesystem::path data = folder / "data";
  const std::vector<ClientFile> first = TinyFiles("a", 300), second = TinyFiles("b", 3000);
  std::vector<ClientFile> all = first;
  all.insert(all.end(), second.begin(), second.end());
  auto server = std::make_unique<PepesegdProcess>(data);
  auto client = std::make_unique<ServiceClient>(server->channel());
  ASSERT_OK(client->CreateScene("shelf"));
  ASSERT_OK_AND_ASSIGN(v1::Upload upload, client->CreateUpload("shelf", all));
  ASSERT_OK(client->WriteFiles(upload, first));
  for (const size_t num_there : {size_t{301}, size_t{900}, size_t{2000}}) {
    std::thread killer([&] {
      ServiceClient watcher(server->channel());
      const absl::Time deadline = absl::Now() + absl::Seconds(60);
      while (absl::Now() < deadline) {
        const auto now = watcher.GetUpload(upload.name());
        if (now.ok() && all.size() - now->missing_files_size() >= num_there) break;
      }
      server->Kill();
    });
    EXPECT_FALSE(client->WriteFiles(upload, second).ok());
    killer.join();
    server = std::make_unique<PepesegdProcess>(data);
    client = std::make_unique<ServiceClient>(server->channel());
    ASSERT_OK_AND_ASSIGN(upload, client->GetUpload(upload.name()));
    EXPECT_LE(upload.missing_files_size(), static_cast<int>(all.size() - num_there));
    if (!upload.missing_files().empty()) {
      EXPECT_GT(upload.missing_files(0), first.back().path) << "was answered, and is lost";
    }
    ExpectStored(data, upload, all);
  }
  ASSERT_OK(client->WriteFiles(upload, second));
  ASSERT_OK(client->SealUpload(upload.name()));
  ExpectStored(data, {}, all);
}

}  // namespace
}  // namespace pepeseg
