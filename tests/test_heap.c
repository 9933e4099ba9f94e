/* The heap beside a plain scan for the entry that belongs on top, in random operations. */
#include "tests/test.h"

#include "src/containers/heap.h"

enum { PLACES = 200, ROUNDS = 20000 };

/* Entries with keys, of which many are equal; the entry of lower number precedes then. */
typedef struct heap_of_keys {
    int32_t count;
    /* [count] Entry at each place. */
    int32_t entry[PLACES];
    /* [PLACES] Key of each entry, and its place; -1: not in the heap. */
    int32_t key[PLACES], place[PLACES];
} heap_of_keys;

static int precedes(const heap_of_keys *heap, int32_t a, int32_t b)
{
    return heap->key[a] != heap->key[b] ? heap->key[a] < heap->key[b] : a < b;
}

static int is_above(const void *context, int32_t a, int32_t b)
{
    const heap_of_keys *heap = context;

    assert_in_range(a, 0, heap->count - 1);
    assert_in_range(b, 0, heap->count - 1);
    return precedes(heap, heap->entry[a], heap->entry[b]);
}

static void exchange(void *context, int32_t a, int32_t b)
{
    heap_of_keys *heap = context;
    int32_t moved = heap->entry[a];

    assert_in_range(a, 0, heap->count - 1);
    assert_in_range(b, 0, heap->count - 1);
    heap->entry[a] = heap->entry[b];
    heap->entry[b] = moved;
    heap->place[heap->entry[a]] = a;
    heap->place[moved] = b;
}

/* The entry that precedes all others, by looking at each. */
static int32_t slow_first(const heap_of_keys *heap)
{
    int32_t first = -1;

    for (int32_t entry = 0; entry < PLACES; entry++)
        if (heap->place[entry] >= 0 && (first < 0 || precedes(heap, entry, first)))
            first = entry;
    return first;
}

static void check_heap(const heap_of_keys *heap)
{
    for (int32_t place = 0; place < heap->count; place++) {
        assert_int_equal(heap->place[heap->entry[place]], place);
        assert_true(place == 0 || precedes(heap, heap->entry[(place - 1) / 2], heap->entry[place]));
    }
    if (heap->count > 0)
        assert_int_equal(heap->entry[0], slow_first(heap));
}

static void add(heap_of_keys *heap, int32_t entry, int32_t key)
{
    heap->entry[heap->count] = entry;
    heap->place[entry] = heap->count;
    heap->key[entry] = key;
    heap->count++;
    heap_sift_up(heap, heap->count - 1, is_above, exchange);
}

static void remove_top(heap_of_keys *heap)
{
    int32_t top = heap->entry[0];

    heap_pop(heap, heap->count, is_above, exchange);
    assert_int_equal(heap->place[top], heap->count - 1);
    heap->count--;
    heap->place[top] = -1;
}

/* Removes an entry of any place. */
static void remove_entry(heap_of_keys *heap, int32_t entry)
{
    heap_remove(heap, heap->place[entry], heap->count, is_above, exchange);
    assert_int_equal(heap->place[entry], heap->count - 1);
    heap->count--;
    heap->place[entry] = -1;
}

static void change_key(heap_of_keys *heap, int32_t entry, int32_t key)
{
    heap->key[entry] = key;
    heap_update(heap, heap->place[entry], heap->count, is_above, exchange);
}

static void top_is_first_after_any_operations(void **state)
{
    static heap_of_keys heap;
    cairn_random random = cairn_random_seed(1, 1);
    int32_t fullest = 0, emptied = 0;

    (void)state;
    memset(heap.place, -1, sizeof heap.place);
    for (int32_t round = 0; round < ROUNDS; round++) {
        /* More are added than removed in every other thousand rounds. */
        int32_t choice = (int32_t)cairn_random_below(&random, 4) - round / 1000 % 2;
        int32_t entry = (int32_t)cairn_random_below(&random, PLACES);
        int32_t key = (int32_t)cairn_random_below(&random, 50);

        if (choice >= 2 && heap.place[entry] < 0)
            add(&heap, entry, key);
        else if (choice < 1 && heap.count > 0)
            remove_top(&heap);
        else if (choice == 1 && key < 10 && heap.place[entry] >= 0)
            remove_entry(&heap, entry);
        else if (heap.place[entry] >= 0)
            change_key(&heap, entry, key);
        check_heap(&heap);
        fullest = heap.count > fullest ? heap.count : fullest;
        emptied += heap.count == 0;
    }
    assert_true(fullest > PLACES / 2 && emptied > 0);
}

static int is_greater(const void *context, int32_t a, int32_t b)
{
    const int32_t *values = context;

    return values[a] > values[b];
}

static void exchange_values(void *context, int32_t a, int32_t b)
{
    int32_t *values = context, moved = values[a];

    values[a] = values[b];
    values[b] = moved;
}

static void sort_puts_the_top_last(void **state)
{
    cairn_random random = cairn_random_seed(2, 1);

    (void)state;
    for (int32_t count = 0; count < PLACES; count++) {
        int32_t values[PLACES], below[PLACES] = {0};

        for (int32_t i = 0; i < count; i++) {
            values[i] = (int32_t)cairn_random_below(&random, 100);
            below[values[i]]++;
        }
        values[count] = -1;
        heap_sort(values, count, is_greater, exchange_values);
        assert_int_equal(values[count], -1);
        for (int32_t i = 0; i < count; i++) {
            assert_true(i == 0 || values[i - 1] <= values[i]);
            below[values[i]]--;
        }
        for (int32_t i = 0; i < PLACES; i++)
            assert_int_equal(below[i], 0);
    }
}

/* Sorts in calls of a budget; returns the units of all. */
static int32_t sort_in_calls(heap_sorting sorting, int32_t *values, int32_t per_call, int32_t units)
{
    int32_t charged = 0, all = 0, is_sorted = 0;

    while (!is_sorted) {
        cairn_budget budget = {per_call};

        is_sorted =
            heap_sort_step(&sorting, &budget, &charged, units, values, is_greater, exchange_values);
        assert_true(budget.left >= 0);
        assert_true(is_sorted || budget.left == 0);
        all += per_call - budget.left;
    }
    assert_int_equal(charged, 0);
    return all;
}

/* The same as at once, for the same units; half of the entries sink to make the heap. */
static void sorts_the_same_in_calls_of_any_budget(void **state)
{
    static const int32_t per_call[] = {1, 7, 1000, CAIRN_UNBOUNDED};
    enum { UNITS = 3 };

    (void)state;
    for (size_t k = 0; k < sizeof per_call / sizeof *per_call; k++)
        for (int32_t count = 0; count < PLACES; count += 1 + count / 5) {
            cairn_random random = cairn_random_seed(4, (uint64_t)count);
            int32_t expected[PLACES], values[PLACES], least = count > 0 ? count - 1 : 0;

            for (int32_t i = 0; i < count; i++)
                expected[i] = values[i] = (int32_t)cairn_random_below(&random, 100);
            heap_sort(expected, count, is_greater, exchange_values);
            assert_int_equal(sort_in_calls(heap_sorting_of(count), values, per_call[k], UNITS),
                             UNITS * (count / 2 + least));
            assert_memory_equal(values, expected, (size_t)count * sizeof *values);
            /* Greatest first is a heap. */
            for (int32_t i = 0; i < count; i++)
                values[i] = expected[count - 1 - i];
            assert_int_equal(sort_in_calls(heap_sorting_of_heap(count), values, per_call[k], UNITS),
                             UNITS * least);
            assert_memory_equal(values, expected, (size_t)count * sizeof *values);
        }
}

static void best_of_many_are_kept_under_the_worst(void **state)
{
    enum { KEPT = 7, OFFERED = 500 };
    cairn_random random = cairn_random_seed(3, 1);
    int32_t kept[KEPT], offered[OFFERED], count = 0;

    (void)state;
    for (int32_t i = 0; i < OFFERED; i++) {
        offered[i] = (int32_t)cairn_random_below(&random, 1000);
        if (count == KEPT && offered[i] >= kept[0])
            continue;
        kept[heap_keep_place(count, KEPT)] = offered[i];
        count = heap_keep(kept, count, KEPT, is_greater, exchange_values);
    }
    heap_sort(offered, OFFERED, is_greater, exchange_values);
    for (; count > 0; count--) {
        assert_int_equal(kept[0], offered[count - 1]);
        heap_pop(kept, count, is_greater, exchange_values);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(top_is_first_after_any_operations),
        cmocka_unit_test(sort_puts_the_top_last),
        cmocka_unit_test(sorts_the_same_in_calls_of_any_budget),
        cmocka_unit_test(best_of_many_are_kept_under_the_worst),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
