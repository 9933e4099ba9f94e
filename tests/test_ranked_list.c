/* The ranked list beside a list of all entries that is sorted and thinned anew, in random
 * operations. */
#include "tests/test.h"

#include "src/containers/ranked_list.h"

enum { CAPACITY = 8, OFFERED = 40, ROUNDS = 2000 };
#define RADIUS CAIRN_REAL(1.5)

typedef struct item {
    int32_t number; /* in the order of their arrival */
    cairn_real place, score;
} item;

static int is_near(const void *context, const void *entry, const void *other)
{
    const item *a = entry, *b = other;

    return cairn_abs(a->place - b->place) < *(const cairn_real *)context;
}

/* As by score, the greatest first. */
static int has_higher_score(const void *context, const void *entry, const void *other)
{
    const item *a = entry, *b = other;

    assert_ptr_equal(context, NULL);
    return a->score > b->score;
}

/* Few scores and places, so that many are equal or near. */
static item random_item(cairn_random *random, int32_t number)
{
    item made = {number, (cairn_real)cairn_random_below(random, 30),
                 (cairn_real)cairn_random_below(random, 12)};

    return made;
}

/* A list that is kept by the simplest means: entries are sorted after each operation. */
typedef struct slow_list {
    item items[OFFERED + 1];
    int32_t count;
} slow_list;

static int comes_before(const item *a, const item *b, int least_first)
{
    if (a->score != b->score)
        return least_first ? a->score < b->score : a->score > b->score;
    return a->number < b->number;
}

static void slow_sort(slow_list *list, int least_first)
{
    for (int32_t i = 0; i < list->count; i++)
        for (int32_t k = 0; k + 1 < list->count; k++)
            if (comes_before(&list->items[k + 1], &list->items[k], least_first)) {
                item moved = list->items[k];

                list->items[k] = list->items[k + 1];
                list->items[k + 1] = moved;
            }
}

static void slow_add(slow_list *list, const item *added, int least_first)
{
    list->items[list->count++] = *added;
    slow_sort(list, least_first);
    if (list->count > CAPACITY)
        list->count = CAPACITY;
}

/* 1 when the entry stays; without those near it, or `one` alone. */
static int slow_suppress(slow_list *list, const item *added, int one)
{
    cairn_real radius = RADIUS;
    int32_t kept = 0, removed = 0;

    for (int32_t i = 0; i < list->count; i++)
        if (is_near(&radius, added, &list->items[i]) && !comes_before(added, &list->items[i], 0))
            return 0;
    for (int32_t i = 0; i < list->count; i++)
        if (is_near(&radius, added, &list->items[i]) && !(one && removed > 0))
            removed++;
        else
            list->items[kept++] = list->items[i];
    list->count = kept;
    return 1;
}

static void check_equal(const item *items, int32_t count, const slow_list *slow)
{
    assert_int_equal(count, slow->count);
    for (int32_t i = 0; i < count; i++)
        assert_int_equal(items[i].number, slow->items[i].number);
}

/* Offers random items to a list without suppression and to a slow one. */
static void compare_with_sorting(ranked_list list, int least_first)
{
    cairn_random random = cairn_random_seed(1, 1);

    for (int32_t round = 0; round < ROUNDS; round++) {
        item items[CAPACITY + 1];
        slow_list slow = {.count = 0};
        int32_t count = 0;

        memset(items, -1, sizeof items);
        list.entries = items;
        list.count = &count;
        for (int32_t i = 0; i < OFFERED; i++) {
            item offered = random_item(&random, i);
            int32_t place = ranked_list_add(&list, &offered);

            slow_add(&slow, &offered, least_first);
            check_equal(items, count, &slow);
            if (place >= 0)
                assert_int_equal(items[place].number, i);
            else
                assert_true(count == CAPACITY && items[count - 1].number != i);
            if (cairn_random_below(&random, 5) == 0) {
                int32_t removed = cairn_random_below(&random, count);

                ranked_list_remove(&list, removed);
                slow.count--;
                for (int32_t k = removed; k < slow.count; k++)
                    slow.items[k] = slow.items[k + 1];
                check_equal(items, count, &slow);
            }
        }
        assert_int_equal(items[CAPACITY].number, -1);
    }
}

static void greatest_scores_come_first(void **state)
{
    (void)state;
    compare_with_sorting((ranked_list){.capacity = CAPACITY,
                                       .entry_bytes = sizeof(item),
                                       .score_at = offsetof(item, score)},
                         0);
}

static void least_scores_come_first_on_request(void **state)
{
    (void)state;
    compare_with_sorting((ranked_list){.capacity = CAPACITY,
                                       .entry_bytes = sizeof(item),
                                       .score_at = offsetof(item, score),
                                       .least_first = 1},
                         1);
}

static void an_order_of_the_caller_ranks(void **state)
{
    (void)state;
    compare_with_sorting((ranked_list){.capacity = CAPACITY,
                                       .entry_bytes = sizeof(item),
                                       .ranks_before = has_higher_score},
                         0);
}

static void a_list_without_capacity_refuses_all(void **state)
{
    int32_t count = 0;
    item offered = {0, 0, 1};
    ranked_list list = {.count = &count,
                        .entries = &offered,
                        .entry_bytes = sizeof offered,
                        .score_at = offsetof(item, score)};

    (void)state;
    assert_int_equal(ranked_list_add(&list, &offered), -1);
    assert_int_equal(count, 0);
}

/* Of near entries the better stays; of better ones than a new one none is removed. */
static void compare_suppression(int one)
{
    cairn_random random = cairn_random_seed(2, 1);
    cairn_real radius = RADIUS;
    int32_t refused = 0, replaced = 0, dropped = 0;

    for (int32_t round = 0; round < ROUNDS; round++) {
        item items[CAPACITY];
        slow_list slow = {.count = 0};
        int32_t count = 0;
        ranked_list list = {.entries = items,
                            .count = &count,
                            .capacity = CAPACITY,
                            .entry_bytes = sizeof *items,
                            .score_at = offsetof(item, score),
                            .is_near = is_near,
                            .context = &radius,
                            .replaces_one = one};

        for (int32_t i = 0; i < OFFERED; i++) {
            item offered = random_item(&random, i);
            int32_t before = slow.count, stays = slow_suppress(&slow, &offered, one);
            int32_t place = ranked_list_insert(&list, &offered);

            refused += !stays;
            replaced += slow.count < before;
            if (stays) {
                dropped += slow.count == CAPACITY;
                slow_add(&slow, &offered, 0);
            }
            check_equal(items, count, &slow);
            assert_true(place < 0 || (stays && items[place].number == i));
        }
    }
    assert_true(refused > ROUNDS && replaced > ROUNDS && dropped > ROUNDS);
}

static void near_entries_are_suppressed(void **state)
{
    (void)state;
    compare_suppression(0);
}

static void one_near_entry_is_replaced_on_request(void **state)
{
    (void)state;
    compare_suppression(1);
}

static void a_filled_list_is_thinned(void **state)
{
    cairn_random random = cairn_random_seed(3, 1);
    cairn_real radius = RADIUS;

    (void)state;
    for (int32_t round = 0; round < ROUNDS; round++) {
        item items[CAPACITY];
        slow_list slow = {.count = 0};
        int32_t count = cairn_random_below(&random, CAPACITY + 1);
        ranked_list list = {.entries = items,
                            .count = &count,
                            .capacity = CAPACITY,
                            .entry_bytes = sizeof *items,
                            .is_near = is_near,
                            .context = &radius};

        for (int32_t i = 0; i < count; i++) {
            int stays = 1;

            items[i] = random_item(&random, i);
            for (int32_t k = 0; k < slow.count; k++)
                stays = stays && !is_near(&radius, &slow.items[k], &items[i]);
            if (stays)
                slow.items[slow.count++] = items[i];
        }
        ranked_list_suppress_all(&list);
        check_equal(items, count, &slow);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(greatest_scores_come_first),
        cmocka_unit_test(least_scores_come_first_on_request),
        cmocka_unit_test(an_order_of_the_caller_ranks),
        cmocka_unit_test(a_list_without_capacity_refuses_all),
        cmocka_unit_test(near_entries_are_suppressed),
        cmocka_unit_test(one_near_entry_is_replaced_on_request),
        cmocka_unit_test(a_filled_list_is_thinned),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
