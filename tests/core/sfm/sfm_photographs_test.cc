#include "core/sfm/sfm_photographs.h"

#include <fstream>

#include "core/base/file_io.h"
#include "core/formats/images.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

using ::testing::ElementsAre;

class SfmPhotographsTest : public ::testing::Test {
 protected:
  void Add(const std::string& name, const std::string& bytes, FileKind kind = FileKind::kImage) {
    const std::filesystem::path path = folder_ / std::to_string(files_.size());
    std::ofstream(path, std::ios::binary) << bytes;
    files_.push_back({kind, name, path});
  }
  // Returns the PNG of a photograph of one grey value.
  static std::string Png(int width, int height, uint8_t grey) {
    Image image{width, height, 1, {}};
    image.pixels.assign(static_cast<size_t>(width) * height, grey);
    return EncodePng(image).value_or("");
  }
  std::vector<SfmPhotograph> Read() const {
    auto photographs = ReadSfmPhotographs(files_);
    EXPECT_OK(photographs);
    return photographs.ok() ? *std::move(photographs) : std::vector<SfmPhotograph>();
  }
  std::vector<std::string> Names() const {
    std::vector<std::string> names;
    for (const SfmPhotograph& photograph : Read()) names.push_back(photograph.name);
    return names;
  }

  testing::TempFolder folder_;
  std::vector<DatasetFile> files_;
};

TEST_F(SfmPhotographsTest, AreSortedByTheirNumbers) {
  for (const char* name : {"images/10.jpg", "images/9.png", "images/b_002.jpg", "images/b_1.jpg"}) {
    Add(name, Png(8, 8, static_cast<uint8_t>(files_.size())));
  }
  EXPECT_THAT(Names(),
              ElementsAre("images/9.png", "images/10.jpg", "images/b_1.jpg", "images/b_002.jpg"));
  EXPECT_TRUE(AreNumbered(Read()));
  Add("images/last.jpg", Png(8, 8, 9));
  EXPECT_FALSE(AreNumbered(Read()));
}

TEST_F(SfmPhotographsTest, ShareACameraIfEqualAndGetTheSuffixOfTheirFormat) {
  Add("images/1.jpg", Png(8, 8, 1));
  Add("images/2.jpg", Png(8, 6, 2));
  Add("images/3.jpg", Png(8, 8, 3));
  ASSERT_OK_AND_ASSIGN(std::vector<SfmPhotograph> photographs, ReadSfmPhotographs(files_));
  EXPECT_THAT(SafeNames(photographs),
              ElementsAre("c1/000001.png", "c2/000002.png", "c1/000003.png"));
  photographs[2].camera.focal_length = 4.2;  // another lens
  EXPECT_THAT(SafeNames(photographs),
              ElementsAre("c1/000001.png", "c2/000002.png", "c3/000003.png"));
}

TEST_F(SfmPhotographsTest, NameAFileThatIsNotAPhotograph) {
  Add("images/1.jpg", "GIF89a no photograph");
  EXPECT_STATUS(ReadSfmPhotographs(files_), absl::StatusCode::kInvalidArgument, "images/1.jpg");
}

TEST_F(SfmPhotographsTest, SufficeIfThreeAreDifferent) {
  for (int i = 0; i < 100; ++i) Add("images/" + std::to_string(i) + ".png", Png(8, 8, 7));
  EXPECT_STATUS(CheckEnough(Read()), absl::StatusCode::kFailedPrecondition,
                "100 photographs, of which only 1 is different");
  Add("images/a.png", Png(8, 8, 8));
  EXPECT_FALSE(CheckEnough(Read()).ok());
  Add("images/b.png", Png(8, 8, 9));
  EXPECT_OK(CheckEnough(Read()));
}

// COLMAP 3.8 does not read colour PNGs of 16 bits.
TEST_F(SfmPhotographsTest, AreLaidOutWithEightBits) {
  Add("images/1.png", EncodePng(Grey16Image{8, 8, std::vector<uint16_t>(64, 0x8080)}).value_or(""));
  ASSERT_OK(LayOut(Read(), folder_ / "i", folder_ / "m"));
  ASSERT_OK_AND_ASSIGN(const std::string copy, ReadFile(folder_ / "i/c1/000001.png", "copy", 1000));
  EXPECT_EQ(copy[24], 8) << "bits a channel";
  ASSERT_OK_AND_ASSIGN(const Image image, DecodePhoto(folder_ / "i/c1/000001.png", "copy"));
  EXPECT_EQ(image.pixels[0], 0x80);
}

TEST_F(SfmPhotographsTest, AreLaidOutWithTheirMasks) {
  Add("images/1.png", Png(8, 6, 1));
  Add("images/2.png", Png(8, 6, 2));
  Add("ignore/2.png", Png(8, 6, 255), FileKind::kIgnoreMask);
  ASSERT_OK_AND_ASSIGN(const auto photographs, ReadSfmPhotographs(files_));
  ASSERT_OK_AND_ASSIGN(const bool any, LayOut(photographs, folder_ / "i", folder_ / "m"));
  EXPECT_TRUE(any);
  EXPECT_FALSE(std::filesystem::is_symlink(folder_ / "i/c1/000001.png"));
  EXPECT_EQ(ReadFile(folder_ / "i/c1/000001.png", "copy", 1 << 20).value_or(""),
            ReadFile(files_[0].path, "photograph", 1 << 20).value_or("none"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "m/c1/000001.png.png"));
  ASSERT_OK_AND_ASSIGN(const FloatImage mask, DecodeGrey(folder_ / "m/c1/000002.png.png", "mask"));
  EXPECT_EQ(mask.width, 8);
  EXPECT_EQ(mask.values.front(), 0);
}

}  // namespace
}  // namespace pepeseg
