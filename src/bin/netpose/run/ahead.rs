//! Work done ahead in other threads, handed out in order.

use std::sync::mpsc::{Receiver, sync_channel};
use std::thread::Scope;

use rayon::ThreadPool;

/// Runs `work` on every item in the pool's threads. Results come in the order of the items, whatever the number of threads; about
/// `depth` items are under way at a time, so memory stays flat. Dropping the iterator ends the reading.
pub fn in_order<'scope, T, R, I, F>(
    scope: &'scope Scope<'scope, '_>,
    pool: &'scope ThreadPool,
    depth: usize,
    items: I,
    work: F,
) -> impl Iterator<Item = R> + use<T, R, I, F>
where
    T: Send + 'static,
    R: Send + 'static,
    I: Iterator<Item = T> + Send + 'scope,
    F: Fn(T) -> R + Send + Clone + 'static,
{
    // A queue of promises: its order is the items' order, its length the bound.
    let (queue, promises) = sync_channel::<Receiver<R>>(depth);
    scope.spawn(move || {
        for item in items {
            let (fulfil, promise) = sync_channel(1);
            if queue.send(promise).is_err() {
                return; // Nobody listens any more.
            }
            let work = work.clone();
            pool.spawn_fifo(move || {
                // Whoever stopped listening does not want the result.
                let _ = fulfil.send(work(item));
            });
        }
    });
    promises.into_iter().map_while(|promise| promise.recv().ok())
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::in_order;

    fn pool(threads: usize) -> rayon::ThreadPool {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap()
    }

    #[test]
    fn results_keep_their_order_for_any_number_of_threads() {
        for threads in [1, 2, 5] {
            let pool = pool(threads);
            let squares: Vec<u64> = std::thread::scope(|scope| {
                in_order(scope, &pool, 3, 0..200u64, |k| {
                    // Later items are quicker: without the queue of promises they would overtake.
                    std::thread::sleep(std::time::Duration::from_micros(200 - k));
                    k * k
                })
                .collect()
            });
            assert_eq!(squares, (0..200).map(|k| k * k).collect::<Vec<_>>());
        }
    }

    #[test]
    fn no_more_than_the_depth_is_read_ahead_and_a_dropped_consumer_ends_the_reading() {
        let pool = pool(2);
        let read = AtomicUsize::new(0);
        std::thread::scope(|scope| {
            let endless = (0u64..).inspect(|_| {
                read.fetch_add(1, Ordering::SeqCst);
            });
            let mut results = in_order(scope, &pool, 4, endless, |k| k);
            assert_eq!(results.next(), Some(0));
            std::thread::sleep(std::time::Duration::from_millis(50));
            // One handed out, four queued, one in the reader's hand.
            assert!(read.load(Ordering::SeqCst) <= 6, "{}", read.load(Ordering::SeqCst));
        });
    }
}
