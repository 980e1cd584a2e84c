#include "server/rpc/resource_name.h"

#include <gtest/gtest.h>

namespace pepeseg {
namespace {

TEST(SceneId, IsAnRfc1034Label) {
  EXPECT_TRUE(IsSceneId("a"));
  EXPECT_TRUE(IsSceneId("apc-shelf2"));
  EXPECT_TRUE(IsSceneId(std::string(63, 'x')));
  for (const char* bad : {"", "-a", "a-", "1a", "A", "a_b", "a/b", "..", "a.b", "ä"}) {
    EXPECT_FALSE(IsSceneId(bad)) << bad;
  }
  EXPECT_FALSE(IsSceneId(std::string(64, 'x')));
  EXPECT_FALSE(IsSceneId(std::string("a\0b", 3)));
}

TEST(ResourceNames, ParseWhatTheyPrint) {
  EXPECT_EQ(*ParseSceneName(SceneName("shelf"), "name"), "shelf");
  const auto child = ParseChildName(ChildName("shelf", "datasets", 12), "datasets", "name");
  ASSERT_TRUE(child.ok());
  EXPECT_EQ(child->scene, "shelf");
  EXPECT_EQ(child->number, 12);
  const auto label = ParseLabelName(LabelName("shelf", "red-cup"), "name");
  ASSERT_TRUE(label.ok());
  EXPECT_EQ(label->scene, "shelf");
  EXPECT_EQ(label->id, "red-cup");
  EXPECT_EQ(*ParseJobName(JobName("j7"), "name"), "j7");
  EXPECT_EQ(ParseModelName("scenes/shelf/models/3", "model")->number, 3);
  EXPECT_EQ(ParseModelName("scenes/shelf/models/live", "model")->number, kLiveModel);
}

TEST(ResourceNames, RefuseAllElse) {
  for (const char* bad : {"", "shelf", "scenes/", "scenes/a/", "scenes/../x", "scenes/A", "/a"}) {
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
       {"", "cup", "scenes/a/labels/", "scenes/a/labels/Cup", "scenes/a/labels/..",
        "scenes/a/models/cup", "scenes/A/labels/cup", "scenes/a/labels/cup/x"}) {
    EXPECT_TRUE(absl::IsInvalidArgument(ParseLabelName(bad, "name").status())) << bad;
  }
  EXPECT_FALSE(ParseModelName("scenes/a/models/dead", "model").ok());
  EXPECT_FALSE(ParseSceneName("scenes/" + std::string(1 << 20, 'a'), "name").ok());
}

}  // namespace
}  // namespace pepeseg
