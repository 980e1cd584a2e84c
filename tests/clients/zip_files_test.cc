#include "clients/terminal/zip_files.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <map>

#include "absl/strings/str_cat.h"
#include "tests/testing/status_testing.h"

namespace pepeseg::client::cli {
namespace {

// Written by Python's zipfile: "a.txt", stored, and "folder/b.txt", deflated.
constexpr char kZip[] =
    "\x50\x4b\x03\x04\x14\x00\x00\x00\x00\x00\x00\x00\x21\x00\x0b\xf9\x43\x56\x06\x00"
    "\x00\x00\x06\x00\x00\x00\x05\x00\x00\x00\x61\x2e\x74\x78\x74\x73\x74\x6f\x72\x65"
    "\x64\x50\x4b\x03\x04\x14\x00\x00\x00\x08\x00\x00\x00\x21\x00\x85\x3c\x36\x55\x0e"
    "\x00\x00\x00\x48\x00\x00\x00\x0c\x00\x00\x00\x66\x6f\x6c\x64\x65\x72\x2f\x62\x2e"
    "\x74\x78\x74\x4b\x49\x4d\xcb\x49\x2c\x49\x4d\x51\x48\xa1\x8c\x01\x00\x50\x4b\x01"
    "\x02\x14\x03\x14\x00\x00\x00\x00\x00\x00\x00\x21\x00\x0b\xf9\x43\x56\x06\x00\x00"
    "\x00\x06\x00\x00\x00\x05\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x80\x01\x00"
    "\x00\x00\x00\x61\x2e\x74\x78\x74\x50\x4b\x01\x02\x14\x03\x14\x00\x00\x00\x08\x00"
    "\x00\x00\x21\x00\x85\x3c\x36\x55\x0e\x00\x00\x00\x48\x00\x00\x00\x0c\x00\x00\x00"
    "\x00\x00\x00\x00\x00\x00\x00\x00\x80\x01\x29\x00\x00\x00\x66\x6f\x6c\x64\x65\x72"
    "\x2f\x62\x2e\x74\x78\x74\x50\x4b\x05\x06\x00\x00\x00\x00\x02\x00\x02\x00\x6d\x00"
    "\x00\x00\x61\x00\x00\x00\x00\x00";
constexpr size_t kZipSize = sizeof(kZip) - 1;

absl::Status ReadZip(const std::string& zip, std::map<std::string, std::string>* files) {
  return ForEachZipFile(zip, [&](const std::string& name, absl::string_view bytes) {
    EXPECT_TRUE(files->emplace(name, bytes).second) << name;
    return absl::OkStatus();
  });
}

TEST(ZipFiles, AreReadAsTheyWereWritten) {
  std::map<std::string, std::string> files;
  ASSERT_OK(ReadZip(std::string(kZip, kZipSize), &files));
  ASSERT_EQ(files.size(), 2U);
  EXPECT_EQ(files["a.txt"], "stored");
  std::string text;
  for (int i = 0; i < 8; ++i) text += "deflated ";
  EXPECT_EQ(files["folder/b.txt"], text);
}

TEST(ZipFiles, EndWithTheErrorOfTheirUse) {
  const absl::Status status = ForEachZipFile(
      std::string(kZip, kZipSize),
      [](const std::string& name, absl::string_view) { return absl::AbortedError(name); });
  EXPECT_EQ(status, absl::AbortedError("a.txt"));
}

TEST(ZipFiles, AreRefusedIfTheyLeadOut) {
  // Names that are as long as those in the zip.
  for (const auto& [name, other] :
       {std::pair("a.txt", "../xy"), {"a.txt", "/a.tx"}, {"folder/b.txt", "a/../../b.tx"}}) {
    std::string zip(kZip, kZipSize);
    const std::string wanted = name;
    for (size_t at = 0; (at = zip.find(wanted, at)) != std::string::npos;) {
      zip.replace(at, wanted.size(), other);
    }
    std::map<std::string, std::string> files;
    EXPECT_TRUE(absl::IsDataLoss(ReadZip(zip, &files))) << other;
    EXPECT_FALSE(files.contains(other));
  }
}

// A zip with any byte changed is read as it was, or refused; where it is cut short it is refused.
TEST(ZipFiles, AreRefusedIfTheyAreDamaged) {
  const std::string whole(kZip, kZipSize);
  std::map<std::string, std::string> want;
  ASSERT_OK(ReadZip(whole, &want));
  int num_refused = 0;
  for (size_t at = 0; at < whole.size(); ++at) {
    std::map<std::string, std::string> files;
    EXPECT_TRUE(absl::IsDataLoss(ReadZip(whole.substr(0, at), &files))) << at;
    for (const int bit : {1, 128}) {
      std::string changed = whole;
      changed[at] = static_cast<char>(changed[at] ^ bit);
      files.clear();
      const absl::Status status = ReadZip(changed, &files);
      num_refused += absl::IsDataLoss(status) ? 1 : 0;
      EXPECT_TRUE(status.ok() || absl::IsDataLoss(status)) << at;
      for (const auto& [name, bytes] : files) {
        EXPECT_TRUE(bytes == want["a.txt"] || bytes == want["folder/b.txt"]) << at;
      }
    }
  }
  EXPECT_GT(num_refused, static_cast<int>(whole.size()) / 2);
}

}  // namespace
}  // namespace pepeseg::client::cli
