/* place_map: poses of the scans, and the result in the frames of the first places. */
#include "src/base/build.h"

#include "src/alignment/place_map_work.h"

/* Odds that a place is wrong, the sum of those of three causes: chance, exp(CHANCE_LOG_ODDS - link
 * support / CHANCE_NATS); a competing pose, exp(COMPETING_LOG_ODDS) times the COMPETING_EXPONENT-th
 * power of its support over that of the place, PLACE_MAP_SHARED_NATS added to both;
 * exp(AMBIGUOUS_LOG_ODDS) where the consensus reports the place as ambiguous. Fitted by
 * `bench/match --fit`. */
#define CHANCE_LOG_ODDS    CAIRN_REAL(0.86)
#define CHANCE_NATS        CAIRN_REAL(10.2)
#define COMPETING_LOG_ODDS CAIRN_REAL(0.08)
#define COMPETING_EXPONENT CAIRN_REAL(3.23)
#define AMBIGUOUS_LOG_ODDS CAIRN_REAL(-2.38)

/* What is read of other places, and alternatives, for one unit. */
enum { PLACES_PER_UNIT = 32, ALTERNATIVES_PER_UNIT = 4 };

static const cairn_real MIN_ERROR_PROBABILITY = CAIRN_REAL(0.001);

/* Error probability above which a place is ambiguous. */
static const cairn_real AMBIGUOUS_ERROR_PROBABILITY = CAIRN_REAL(0.3);

cairn_real cairn_place_map_error_probability(cairn_real support, cairn_real competing,
                                             cairn_real link_support, int32_t is_ambiguous)
{
    cairn_real by_chance = cairn_exp(CHANCE_LOG_ODDS - cairn_max(link_support, 0) / CHANCE_NATS);
    cairn_real ratio =
        (PLACE_MAP_SHARED_NATS + competing) / (PLACE_MAP_SHARED_NATS + cairn_max(support, 0));
    cairn_real by_competing = cairn_exp(COMPETING_LOG_ODDS + COMPETING_EXPONENT * cairn_log(ratio));
    cairn_real odds = by_chance + by_competing + (is_ambiguous ? cairn_exp(AMBIGUOUS_LOG_ODDS) : 0);

    return cairn_max(odds / (1 + odds), MIN_ERROR_PROBABILITY);
}

cairn_real cairn_place_map_competing_support(const cairn_place_map *map, int32_t place)
{
    int32_t count = cairn_pose_consensus_node(map->consensus, place).alternatives;
    cairn_real best = 0;

    for (int32_t i = 0; i < count; i++) {
        cairn_pose_consensus_competing_pose pose =
            cairn_pose_consensus_alternative(map->consensus, place, i);

        if (!pose.is_other_map)
            best = cairn_max(best, pose.support);
    }
    return best;
}

static int is_alone(const cairn_place_map *map, int32_t place)
{
    for (int32_t i = 0; i < map->place_count; i++)
        if (i != place && map->places[i].component == map->places[place].component)
            return 0;
    return 1;
}

void cairn_place_map_report(const cairn_place_map *map, int32_t place, cairn_place_map_place *out)
{
    cairn_pose_consensus_estimate node = cairn_pose_consensus_node(map->consensus, place);

    out->support = node.support;
    out->submap = node.submap;
    out->alternatives = node.alternatives;
    out->link_support = node.link_support;
    out->ambiguous = node.ambiguous;
    if (is_alone(map, place))
        return;
    out->error_probability = cairn_place_map_error_probability(
        node.support, cairn_place_map_competing_support(map, place), node.link_support,
        node.ambiguous);
    out->ambiguous |= out->error_probability > AMBIGUOUS_ERROR_PROBABILITY;
}

void cairn_place_map_place_scans(cairn_place_map *map, int32_t place)
{
    const place_map_place *here = &map->places[place];

    for (int32_t s = here->first_scan; s < here->first_scan + here->scan_count; s++)
        map->scans[s].map_scan = cairn_pose_compose(here->map_place, map->scans[s].place_scan);
}

static int32_t first_of_part(const cairn_place_map *map, int32_t place)
{
    int32_t first = 0;

    while (map->places[first].component != map->places[place].component)
        first++;
    return first;
}

static int32_t count_placed(const cairn_place_map *map)
{
    int32_t placed = 0;

    for (int32_t i = 0; i < map->place_count; i++)
        placed += map->places[i].component == 0;
    return placed;
}

static int32_t count_ambiguous(const cairn_place_map *map)
{
    int32_t ambiguous = 0;

    for (int32_t i = 0; i < map->place_count && map->params.mode == CAIRN_PLACE_MAP_CONSENSUS;
         i++) {
        cairn_place_map_place place = {.error_probability = 1};

        cairn_place_map_report(map, i, &place);
        ambiguous += place.ambiguous;
    }
    return ambiguous;
}

int32_t cairn_place_map_finish_units(const cairn_place_map *map)
{
    int32_t per_place = 1 + map->place_count / PLACES_PER_UNIT +
                        map->params.consensus.max_alternatives / ALTERNATIVES_PER_UNIT;

    return map->scan_count + map->place_count * per_place;
}

/* The last places first, as they need the first one's pose unchanged. */
void cairn_place_map_finish(cairn_place_map *map)
{
    cairn_place_map_result *result = &map->result;

    result->places = map->place_count;
    for (int32_t i = map->place_count - 1; i >= 0; i--) {
        place_map_place *place = &map->places[i];
        cairn_pose part_map = cairn_pose_inverse(map->places[first_of_part(map, i)].map_place);

        for (int32_t s = place->first_scan; s < place->first_scan + place->scan_count; s++)
            map->scans[s].map_scan = cairn_pose_compose(part_map, map->scans[s].map_scan);
        place->map_place = cairn_pose_compose(part_map, place->map_place);
        result->components =
            place->component >= result->components ? place->component + 1 : result->components;
    }
    result->placed = count_placed(map);
    result->ambiguous = count_ambiguous(map);
}
