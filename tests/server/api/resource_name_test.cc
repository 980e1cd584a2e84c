#include "server/api/resource_name.h"

#include <gtest/gtest.h>

#include <set>
#include <string>
#include <vector>

#include "server/store/layout.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

TEST(CheckId, AcceptsCommonNames) {
  for (const char* id : {"a", "apc-shelf2", "llff_horns", "Fern-2", "1a", "v1.0", "a-", "x.."}) {
    EXPECT_OK(CheckId(id, "scene_id")) << id;
  }
  EXPECT_OK(CheckId(std::string(63, 'x'), "scene_id"));
}

TEST(CheckId, RefusesNamesThatAreNotPlainFileNames) {
  for (const char* bad :
       {"", ".", "..", ".a", "-a", "_a", "a/b", "a b", "a\nb", "a%b", "a'b", "a\\b", "ä", "@1"}) {
    const absl::Status refused = CheckId(bad, "scene_id");
    EXPECT_TRUE(absl::IsInvalidArgument(refused)) << bad;
    EXPECT_NE(refused.message().find("beginning with a letter or a digit"), std::string::npos);
  }
  EXPECT_FALSE(CheckId(std::string(64, 'x'), "scene_id").ok());
  EXPECT_FALSE(CheckId(std::string("a\0b", 3), "scene_id").ok());
}

TEST(CheckProject, AcceptsRfc1034LabelsOnly) {
  EXPECT_OK(CheckProject("lab-2", "project"));
  for (const char* bad : {"", "Lab", "a_b", "a.b", "2a", "a-"}) {
    EXPECT_TRUE(absl::IsInvalidArgument(CheckProject(bad, "project"))) << bad;
  }
}

TEST(SceneFolderName, DiffersBetweenIdsAlsoWithoutCase) {
  EXPECT_EQ(SceneFolderName("apc-shelf2"), "apc-shelf2");
  std::set<std::string> folders;
  const std::vector<std::string> ids = {"fern",  "Fern",  "_fern", "FERN", "fe_rn", "fe.rn",
                                        "fe-rn", "fe_-n", "fe.n",  "a..b", "a_.b",  "a.tmp-1"};
  for (const std::string& id : ids) {
    const std::string folder = SceneFolderName(id);
    EXPECT_EQ(SceneOfFolderName(folder), id);
    EXPECT_EQ(folder.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789-_"), std::string::npos)
        << folder;
    EXPECT_TRUE(folders.insert(folder).second) << folder;
  }
  for (const char* none : {"", "_", "a_", "a_1", "Fern", "a.b"}) {
    EXPECT_EQ(SceneOfFolderName(none), "") << none;
  }
}

TEST(ResourceNames, ParseWhatTheyPrint) {
  EXPECT_EQ(*ParseSceneName(SceneName("shelf"), "name"), "shelf");
  ASSERT_OK_AND_ASSIGN(const auto child,
                       ParseChildName(ChildName("shelf", "datasets", 12), "datasets", "name"));
  EXPECT_EQ(child.scene, "shelf");
  EXPECT_EQ(child.number, 12);
  ASSERT_OK_AND_ASSIGN(const auto label, ParseLabelName(LabelName("shelf", "red-cup"), "name"));
  EXPECT_EQ(label.scene, "shelf");
  EXPECT_EQ(label.id, "red-cup");
  EXPECT_EQ(*ParseJobName(JobName("j7"), "name"), "j7");
  EXPECT_EQ(ParseModelName("scenes/shelf/models/3", "model")->number, 3);
  EXPECT_EQ(ParseModelName("scenes/shelf/models/live", "model")->number, kLiveModel);
}

TEST(ResourceNames, RefuseEverythingElse) {
  for (const char* bad : {"", "shelf", "scenes/", "scenes/a/", "scenes/../x", "scenes/.a", "/a"}) {
    const auto name = ParseSceneName(bad, "scene");
    EXPECT_TRUE(absl::IsInvalidArgument(name.status())) << bad;
    EXPECT_NE(name.status().message().find("scene: '"), std::string::npos) << name.status();
  }
  for (const char* bad :
       {"scenes/a/datasets/0", "scenes/a/datasets/01", "scenes/a/datasets/-1",
        "scenes/a/datasets/+1", "scenes/a/datasets/1x", "scenes/a/datasets/", "scenes/a/models/1",
        "scenes/a/datasets/99999999999999999999", "scenes/a/datasets/1/x"}) {
    EXPECT_TRUE(absl::IsInvalidArgument(ParseChildName(bad, "datasets", "name").status())) << bad;
  }
  for (const char* bad : {"jobs/", "jobs/7", "jobs/j", "jobs/j0", "jobs/j1/x", "jobs/j../../x"}) {
    EXPECT_TRUE(absl::IsInvalidArgument(ParseJobName(bad, "name").status())) << bad;
  }
  for (const char* bad :
       {"", "cup", "scenes/a/labels/", "scenes/a/labels/_cup", "scenes/a/labels/..",
        "scenes/a/models/cup", "scenes/../labels/cup", "scenes/a/labels/cup/x"}) {
    EXPECT_TRUE(absl::IsInvalidArgument(ParseLabelName(bad, "name").status())) << bad;
  }
  EXPECT_FALSE(ParseModelName("scenes/a/models/dead", "model").ok());
  EXPECT_FALSE(ParseSceneName("scenes/" + std::string(1 << 20, 'a'), "name").ok());
}

}  // namespace
}  // namespace pepeseg
