#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <iterator>
#include <limits>
#include <string>

#include "core/base/digest.h"
#include "core/base/file_io.h"
#include "core/priors/sam/sam_embedding.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

constexpr size_t kNumValues = size_t{64} * 64 * 256;

struct EmbeddingFileTest : ::testing::Test {
  EmbeddingFileTest() {
    for (size_t i = 0; i < kNumValues; ++i) {
      embedding.values.push_back(HalfFromFloat(0.01F * static_cast<float>(i % 1000) - 5));
    }
  }
  absl::Status ErrorOf(const EmbeddingOrigin& of) { return ReadEmbedding(path, of).status(); }

  testing::TempFolder folder;
  const std::filesystem::path path = folder / "embedding.bin";
  const EmbeddingOrigin origin = {Sha256Hex("an encoder"), Sha256Hex("a photograph")};
  SamEmbedding embedding = {640, 480, {}};
};

TEST_F(EmbeddingFileTest, ReturnsWhatWasWritten) {
  ASSERT_OK(WriteEmbedding(path, embedding, origin));
  EXPECT_EQ(std::filesystem::file_size(path), static_cast<uint64_t>(kEmbeddingFileBytes));
  ASSERT_OK_AND_ASSIGN(const SamEmbedding read, ReadEmbedding(path, origin));
  EXPECT_EQ(read.width, 640);
  EXPECT_EQ(read.height, 480);
  ASSERT_EQ(read.values.size(), kNumValues);
  for (size_t i = 0; i < kNumValues; ++i) {
    ASSERT_EQ(read.values[i].bits, embedding.values[i].bits) << i;
  }
  // Nothing else is left in the folder.
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 1);
}

TEST_F(EmbeddingFileTest, IsOfOneEncoderAndOnePhotograph) {
  ASSERT_OK(WriteEmbedding(path, embedding, origin));
  EXPECT_TRUE(absl::IsFailedPrecondition(ErrorOf({Sha256Hex("another"), origin.photograph})));
  EXPECT_TRUE(absl::IsFailedPrecondition(ErrorOf({origin.encoder, Sha256Hex("another")})));
  EXPECT_OK(ErrorOf({origin.encoder, ""}));
  ASSERT_OK(WriteEmbedding(path, embedding, {origin.encoder, ""}));
  EXPECT_OK(ErrorOf({origin.encoder, ""}));
  EXPECT_TRUE(absl::IsFailedPrecondition(ErrorOf(origin)));
}

TEST_F(EmbeddingFileTest, IsNotFoundWhereThereIsNone) {
  EXPECT_TRUE(absl::IsNotFound(ErrorOf(origin)));
  EXPECT_FALSE(WriteEmbedding(folder / "none" / "file", embedding, origin).ok());
}

TEST_F(EmbeddingFileTest, RefusesDamagedFiles) {
  ASSERT_OK(WriteEmbedding(path, embedding, origin));
  ASSERT_OK_AND_ASSIGN(const std::string whole, ReadFile(path, "whole", kEmbeddingFileBytes));
  // A byte of each part: mark, version, sizes, count, digests, values, checksum.
  for (const size_t at : {size_t{0}, size_t{9}, size_t{13}, size_t{21}, size_t{30}, size_t{100},
                          size_t{5000}, whole.size() - 1}) {
    std::string damaged = whole;
    damaged[at] = static_cast<char>(damaged[at] ^ 4);
    ASSERT_OK(WriteFileAtomically(path, damaged));
    EXPECT_TRUE(absl::IsDataLoss(ErrorOf(origin))) << at;
  }
  for (const size_t size :
       {size_t{0}, size_t{7}, size_t{155}, size_t{156}, whole.size() / 2, whole.size() - 1}) {
    ASSERT_OK(WriteFileAtomically(path, whole.substr(0, size)));
    EXPECT_TRUE(absl::IsDataLoss(ErrorOf(origin))) << size;
  }
  ASSERT_OK(WriteFileAtomically(path, whole + "x"));
  EXPECT_TRUE(absl::IsDataLoss(ErrorOf(origin)));
}

// A worker that has read a stranger's photograph may write any file with a good checksum.
TEST_F(EmbeddingFileTest, RefusesValuesThatAreNotFinite) {
  for (const float value :
       {std::numeric_limits<float>::infinity(), -std::numeric_limits<float>::infinity(),
        std::numeric_limits<float>::quiet_NaN()}) {
    SamEmbedding other = embedding;
    other.values[777] = HalfFromFloat(value);
    ASSERT_OK(WriteEmbedding(path, other, origin));
    EXPECT_TRUE(absl::IsDataLoss(ErrorOf(origin))) << value;
  }
  ASSERT_OK(WriteEmbedding(path, {0, 480, embedding.values}, origin));
  EXPECT_TRUE(absl::IsDataLoss(ErrorOf(origin)));
}

TEST(EmbeddingFileName, DiffersByPhotographAndIsAPlainName) {
  EXPECT_NE(EmbeddingFileName("a/1.jpg"), EmbeddingFileName("a/2.jpg"));
  EXPECT_EQ(EmbeddingFileName("../../etc/passwd").find('/'), std::string::npos);
}

}  // namespace
}  // namespace pepeseg
