#include "core/formats/zip_writer.h"

#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/unzipped.h"

namespace pepeseg {
namespace {

using Method = ZipWriter::Method;

TEST(ZipWriter, GivesTheFilesAgain) {
  const std::string long_text(100'000, 'a');
  std::string zips[2];
  for (std::string& zip : zips) {
    ZipWriter writer;
    ASSERT_OK(writer.Add("empty", "", Method::kDeflated));
    ASSERT_OK(writer.Add("folder/long.txt", long_text, Method::kDeflated));
    ASSERT_OK(writer.Add("folder/stored.txt", long_text.substr(0, 5000), Method::kStored));
    ASSERT_OK(writer.Add("Übergröße", "ab", Method::kDeflated));
    EXPECT_GT(writer.num_bytes(), 5000);
    EXPECT_LT(writer.num_bytes(), 6000);
    ASSERT_OK_AND_ASSIGN(zip, std::move(writer).Finish());
  }
  EXPECT_EQ(zips[0], zips[1]);
  const auto files = testing::Unzipped(zips[0]);
  ASSERT_EQ(files.size(), 4U);
  EXPECT_EQ(files.at("empty"), "");
  EXPECT_EQ(files.at("folder/long.txt"), long_text);
  EXPECT_EQ(files.at("folder/stored.txt"), long_text.substr(0, 5000));
  EXPECT_EQ(files.at("Übergröße"), "ab");
}

TEST(ZipWriter, ListsAnyNumberOfFiles) {
  for (const int count : {0, 65'534, 65'535, 70'000}) {
    ZipWriter writer;
    for (int i = 0; i < count; ++i) ASSERT_OK(writer.Add(absl::StrCat(i), "", Method::kStored));
    ASSERT_OK_AND_ASSIGN(const std::string zip, std::move(writer).Finish());
    EXPECT_EQ(testing::Unzipped(zip).size(), static_cast<size_t>(count));
    // Readers without Zip64 read a zip that needs none.
    EXPECT_EQ(zip.find("PK\6\6") != std::string::npos, count > 65'534) << count;
  }
}

}  // namespace
}  // namespace pepeseg
