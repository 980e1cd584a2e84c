#include "core/model_files/checkpoint.h"

#include <fstream>

#include "core/base/digest.h"
#include "core/base/file_io.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

class CheckpointTest : public ::testing::Test {
 protected:
  CheckpointTest() : path_(folder_.path() / "step-5.ckpt") {
    EXPECT_OK(WriteCheckpoint(path_, {"reconstruct", "ab12", 5}, sections_));
  }

  std::string Bytes() { return ReadFile(path_, "checkpoint", 1 << 20).value_or(""); }
  void SetBytes(const std::string& bytes) { std::ofstream(path_, std::ios::binary) << bytes; }
  // Writes the bytes with a valid checksum.
  void SetSealed(const std::string& bytes) { SetBytes(bytes + Sha256Hex(bytes)); }

  testing::TempFolder folder_;
  std::filesystem::path path_;
  std::string binary_ = std::string("\0\xff two", 6);
  std::vector<CheckpointSection> sections_ = {{"a", 1, "one"}, {"empty", 3, ""}, {"b", 2, binary_}};
};

TEST_F(CheckpointTest, RoundTrips) {
  ASSERT_OK_AND_ASSIGN(Checkpoint read, ReadCheckpoint(path_));
  const Checkpoint moved = std::move(read);  // the sections still point at its bytes
  EXPECT_EQ(moved.header.stage, "reconstruct");
  EXPECT_EQ(moved.header.identity, "ab12");
  EXPECT_EQ(moved.header.step, 5);
  ASSERT_EQ(moved.sections.size(), 3u);
  for (size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(moved.sections[i].name, sections_[i].name);
    EXPECT_EQ(moved.sections[i].version, sections_[i].version);
    EXPECT_EQ(moved.sections[i].bytes, sections_[i].bytes);
  }
}

TEST_F(CheckpointTest, RejectsAnyFlippedByteNamingTheFile) {
  const std::string good = Bytes();
  for (size_t i = 0; i < good.size(); ++i) {
    std::string bad = good;
    bad[i] = static_cast<char>(bad[i] ^ 0x10);
    SetBytes(bad);
    SCOPED_TRACE(i);
    EXPECT_STATUS(ReadCheckpoint(path_), absl::StatusCode::kDataLoss, "step-5.ckpt");
  }
  SetBytes(good);
  EXPECT_OK(ReadCheckpoint(path_));
}

TEST_F(CheckpointTest, RejectsAnyTruncation) {
  const std::string good = Bytes();
  for (size_t size = 0; size < good.size(); ++size) {
    SetBytes(good.substr(0, size));
    SCOPED_TRACE(size);
    EXPECT_STATUS(ReadCheckpoint(path_), absl::StatusCode::kDataLoss, "step-5.ckpt");
  }
  SetBytes(good + "x");
  EXPECT_STATUS(ReadCheckpoint(path_), absl::StatusCode::kDataLoss, "checksum");
}

// A file with a valid checksum may still be malformed.
TEST_F(CheckpointTest, RejectsMalformedFilesWithAValidChecksum) {
  const auto header = [](const std::string& json) {
    std::string bytes("PEPECKPT\1\0\0\0\0\0\0\0", 16);
    bytes[12] = static_cast<char>(json.size());
    return bytes + json;
  };
  const auto expect = [&](const std::string& bytes, const char* why) {
    SetSealed(bytes);
    EXPECT_STATUS(ReadCheckpoint(path_), absl::StatusCode::kDataLoss, why);
  };
  expect(std::string("PEPECKPT\2\0\0\0\0\0\0\0", 16), "format 2");
  expect(std::string("PEPECKPT\1\0\0\0\xff\xff\xff\xff", 16), "too long");
  expect(header("[]"), "not a JSON object");
  expect(header(R"({"stage":"s","identity":3,"step":1,"sections":[]})"), "header");
  expect(header(R"({"stage":"s","identity":"i","step":1})"), "header");
  const std::string section = R"({"stage":"s","identity":"i","step":1,"sections":[{"name":"a",)"
                              R"("version":1,"size":)";
  expect(header(section + "4}]}") + "abc", "longer than the file");
  expect(header(section + "18446744073709551615}]}") + "abc", "longer than the file");
  expect(header(section + "2}]}") + "abc", "after its last section");
  SetSealed(header(section + "3}]}") + "abc");
  EXPECT_OK(ReadCheckpoint(path_));
}

TEST_F(CheckpointTest, ReportsAMissingFile) {
  EXPECT_STATUS(ReadCheckpoint(folder_.path() / "none"), absl::StatusCode::kNotFound, "none");
}

}  // namespace
}  // namespace pepeseg
