#include "core/find/word_match.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "core/find/wordnet.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using Words = std::vector<std::string>;

Words NoSynonyms(const std::string&) { return {}; }
Words Couches(const std::string& noun) {
  if (noun == "sofa") return {"couch", "lounge"};
  return noun == "motor car" ? Words{"car", "automobile"} : Words{};
}

TEST(WordsOf, LowersAndSplitsAndDropsArticles) {
  EXPECT_EQ(WordsOf("The red-Cup, 2"), (Words{"red", "cup", "2"}));
  EXPECT_EQ(WordsOf("Türen"), (Words{"türen"}));
  EXPECT_THAT(WordsOf(" the ... "), IsEmpty());
}

TEST(WordsOf, MakesPluralsSingular) {
  EXPECT_EQ(WordsOf("mugs berries boxes dishes glasses people knives"),
            (Words{"mug", "berry", "box", "dish", "glass", "person", "knife"}));
  EXPECT_EQ(WordsOf("glass bus iris gas"), (Words{"glass", "bus", "iris", "gas"}));
}

TEST(NameScore, IsHighestForTheSameWords) {
  EXPECT_EQ(NameScore("the red cups", "Red cup", NoSynonyms), 1);
  EXPECT_EQ(NameScore("cup", "red cup", NoSynonyms), 0.9);
  EXPECT_EQ(NameScore("red cu", "red cup", NoSynonyms), 0) << "two letters";
  EXPECT_EQ(NameScore("bott", "wine bottle", NoSynonyms), 0.8);
  EXPECT_EQ(NameScore("the big red cup", "cup", NoSynonyms), 0.5);
}

TEST(NameScore, IsZeroWhereAWordIsUnknown) {
  EXPECT_EQ(NameScore("red cup", "red book", NoSynonyms), 0);
  EXPECT_EQ(NameScore("", "cup", NoSynonyms), 0);
  EXPECT_EQ(NameScore("cup", "?", NoSynonyms), 0);
}

TEST(NameScore, KnowsSynonymsOfWordsAndPhrases) {
  EXPECT_EQ(NameScore("sofas", "blue couch", Couches), 0.7);
  EXPECT_EQ(NameScore("motor car", "automobile", Couches), 0.7);
}

TEST(AlmostSpelt, SuggestsTheNearestFirst) {
  EXPECT_THAT(AlmostSpelt("bottlee", {"cup", "battle", "bottles"}, 5),
              ElementsAre("bottles", "battle"));
  EXPECT_THAT(AlmostSpelt("bottlee", {"battle", "bottles"}, 1), ElementsAre("bottles"));
  EXPECT_THAT(AlmostSpelt("zebra", {"cup", "bottle"}, 5), IsEmpty());
}

// Files as those of WordNet, with a licence in front, which begins with two spaces.
struct WordNetTest : ::testing::Test {
  void SetUp() override {
    const std::string licence = "  1 a licence of two lines  \n  2 that ends here  \n";
    std::string data = licence, index = licence;
    const auto add = [&](const std::string& words) {
      const std::string offset = std::to_string(data.size());
      data += std::string(8 - offset.size(), '0') + offset + " 06 n " + words + " 0 000 | what\n";
      return std::string(8 - offset.size(), '0') + offset;
    };
    const std::string car = add("03 car 0 auto 0 Motor_Car 0"), cabin = add("02 car 1 gondola 0");
    index += "auto n 1 1 @ 1 1 " + car + "  \n";
    index += "car n 2 3 @ ~ #p 2 1 " + car + " " + cabin + "  \n";
    index += "gondola n 1 0 1 0 " + cabin + "  \n";
    index += "motor_car n 1 0 1 0 " + car + "  \n";
    std::ofstream(folder / "index.noun") << index;
    std::ofstream(folder / "data.noun") << data;
  }
  testing::TempFolder folder;
};

TEST_F(WordNetTest, ListsTheNounsOfAllMeanings) {
  ASSERT_OK_AND_ASSIGN(const auto wordnet, WordNet::Open(folder.path()));
  EXPECT_THAT(wordnet->SynonymsOf("car"), ElementsAre("auto", "motor car", "gondola"));
  EXPECT_THAT(wordnet->SynonymsOf("Auto"), ElementsAre("car", "auto", "motor car"));
  EXPECT_THAT(wordnet->SynonymsOf("gondola"), ElementsAre("car"));
  EXPECT_THAT(wordnet->SynonymsOf("motor car"), ElementsAre("car", "auto"));
}

TEST_F(WordNetTest, KnowsNothingOfOtherWords) {
  ASSERT_OK_AND_ASSIGN(const auto wordnet, WordNet::Open(folder.path()));
  for (const char* const word : {"", "a", "bus", "ca", "cart", "zoo", "licence", "1"}) {
    EXPECT_THAT(wordnet->SynonymsOf(word), IsEmpty()) << word;
  }
}

TEST_F(WordNetTest, SurvivesDamage) {
  std::ofstream(folder / "index.noun") << "car n 2 3 @ ~ #p 2 1 99999999 7\nauto\nx n -1 -1";
  ASSERT_OK_AND_ASSIGN(const auto wordnet, WordNet::Open(folder.path()));
  EXPECT_THAT(wordnet->SynonymsOf("auto"), IsEmpty());
  EXPECT_THAT(wordnet->SynonymsOf("x"), IsEmpty());
  wordnet->SynonymsOf("car");
}

TEST(WordNet, SaysThatItIsNotThere) {
  const testing::TempFolder folder;
  EXPECT_STATUS(WordNet::Open(folder.path()), absl::StatusCode::kNotFound, "data.noun");
}

}  // namespace
}  // namespace pepeseg
