#include "core/model_files/manifest.h"

#include <gtest/gtest.h>

#include "core/base/file_io.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

using absl::StatusCode::kDataLoss;
using testing::TempFolder;

Manifest WriteTwoFiles(const TempFolder& folder) {
  EXPECT_OK(WriteFileAtomically(folder / "a", "first"));
  EXPECT_OK(WriteFileAtomically(folder / "b", "second"));
  absl::StatusOr<Manifest> manifest =
      BuildManifest(folder.path(), std::vector<std::string>{"a", "b"});
  EXPECT_OK(manifest);
  EXPECT_OK(WriteManifest(folder.path(), *manifest));
  return *std::move(manifest);
}

TEST(Manifest, RoundTripsAndVerifies) {
  const TempFolder folder;
  WriteTwoFiles(folder);
  ASSERT_OK_AND_ASSIGN(const Manifest manifest, ReadManifest(folder.path()));
  EXPECT_TRUE(manifest.Lists("b"));
  EXPECT_FALSE(manifest.Lists("c"));
  EXPECT_OK(VerifyManifest(folder.path(), manifest));
}

TEST(Manifest, NamesTheFileThatChanged) {
  const TempFolder folder;
  const Manifest manifest = WriteTwoFiles(folder);
  ASSERT_OK(WriteFileAtomically(folder / "b", "secunde"));
  EXPECT_STATUS(VerifyManifest(folder.path(), manifest), kDataLoss, "/b: has 7 bytes");
  ASSERT_OK(WriteFileAtomically(folder / "b", "secund"));
  EXPECT_STATUS(VerifyManifest(folder.path(), manifest), kDataLoss, "/b: its checksum differs");
  std::filesystem::remove(folder / "b");
  EXPECT_STATUS(VerifyManifest(folder.path(), manifest), kDataLoss, "/b: the manifest lists it");
}

TEST(ReadListedFile, ReturnsOnlyWhatTheManifestLists) {
  const TempFolder folder;
  WriteTwoFiles(folder);
  const auto read = [&](const std::string& name) {
    return ReadListedFile(folder.path(), name, 100);
  };
  EXPECT_EQ(*read("b"), "second");
  ASSERT_OK(WriteFileAtomically(folder / "c", "other"));
  EXPECT_STATUS(read("c").status(), kDataLoss, "/c: its manifest lists no such file");
  ASSERT_OK(WriteFileAtomically(folder / "b", "secund"));
  EXPECT_STATUS(read("b").status(), kDataLoss, "/b: its checksum differs");
  std::filesystem::remove(folder / "b");
  EXPECT_STATUS(read("b").status(), kDataLoss, "/b: it is not there");
}

TEST(Manifest, IsRejectedIfMissingOrMalformed) {
  const TempFolder folder;
  EXPECT_EQ(ReadManifest(folder.path()).status().code(), absl::StatusCode::kNotFound);
  const std::string sha(64, '0');
  for (const std::string& text : {
           std::string("{"),
           std::string("[]"),
           std::string(R"({"version": 2, "files": []})"),
           std::string(R"({"version": 1})"),
           std::string(R"({"version": 1, "files": [3]})"),
           R"({"version": 1, "files": [{"name": "../a", "size": 1, "sha256": ")" + sha + "\"}]}",
           R"({"version": 1, "files": [{"name": "a", "size": -1, "sha256": ")" + sha + "\"}]}",
           R"({"version": 1, "files": [{"name": "a", "size": 1.5, "sha256": ")" + sha + "\"}]}",
           std::string(R"({"version": 1, "files": [{"name": "a", "size": 1, "sha256": "0"}]})"),
       }) {
    ASSERT_OK(WriteFileAtomically(folder / kManifestName, text));
    SCOPED_TRACE(text);
    EXPECT_STATUS(ReadManifest(folder.path()), kDataLoss, "manifest.json");
  }
}

}  // namespace
}  // namespace pepeseg
