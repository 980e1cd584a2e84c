#include "core/base/file_name.h"

#include <gtest/gtest.h>

#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

TEST(ValidateName, AcceptsRelativeNames) {
  for (const char* name : {"a.jpg", "images/cam 0/a.jpg", "..a/b..", "\xC3\xA4/\xE2\x82\xAC.png",
                           "\xF0\x9F\x8D\x8E.jpg", ".hidden"}) {
    EXPECT_OK(ValidateName(name));
  }
}

TEST(ValidateName, RejectsNamesThatEscapeTheFolderOrMislead) {
  using absl::StatusCode::kInvalidArgument;
  EXPECT_STATUS(ValidateName(""), kInvalidArgument, "is empty");
  EXPECT_STATUS(ValidateName("../../x"), kInvalidArgument, "\"../../x\"");
  EXPECT_STATUS(ValidateName("a/../x"), kInvalidArgument, "a/../x");
  EXPECT_STATUS(ValidateName("./x"), kInvalidArgument, "./x");
  EXPECT_STATUS(ValidateName("/etc/passwd"), kInvalidArgument, "absolute");
  EXPECT_STATUS(ValidateName("a//b"), kInvalidArgument, "empty part");
  EXPECT_STATUS(ValidateName("a/"), kInvalidArgument, "empty part");
  EXPECT_STATUS(ValidateName("a\nb"), kInvalidArgument, "a\\nb");
  EXPECT_STATUS(ValidateName(absl::string_view("a\0b", 3)), kInvalidArgument, "a\\000b");
  EXPECT_STATUS(ValidateName(std::string(1025, 'x')), kInvalidArgument, "1024");
}

TEST(ValidateName, RejectsNamesThatAreNotUtf8) {
  for (const char* name : {"\x80", "\xC0\xAF", "\xC3", "a\xE2\x82", "\xED\xA0\x80",
                           "\xF4\x90\x80\x80", "\xE0\x80\xAF", "\xFF"}) {
    EXPECT_STATUS(ValidateName(name), absl::StatusCode::kInvalidArgument, "UTF-8");
  }
}

TEST(FileName, SplitsFolderAndSuffix) {
  EXPECT_EQ(WithoutFolder("images/a/b.jpg", "images"), "a/b.jpg");
  EXPECT_EQ(WithoutFolder("images2/a.jpg", "images"), "images2/a.jpg");
  EXPECT_EQ(WithoutSuffix("a.b/c.d.JPG"), "a.b/c.d");
  EXPECT_EQ(WithoutSuffix("a.b/c"), "a.b/c");
  EXPECT_EQ(Suffix("a.b/c.d.JPG"), ".jpg");
  EXPECT_EQ(Suffix("a.b/.c"), "");
}

}  // namespace
}  // namespace pepeseg
