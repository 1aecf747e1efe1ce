//! Dense linear algebra as one writes it on paper, for tests to compare with.

pub type Matrix = Vec<Vec<f64>>;

pub fn zeros(rows: usize, columns: usize) -> Matrix {
    vec![vec![0.0; columns]; rows]
}

pub fn transposed(a: &Matrix) -> Matrix {
    (0..a[0].len()).map(|j| a.iter().map(|row| row[j]).collect()).collect()
}

pub fn product(a: &Matrix, b: &Matrix) -> Matrix {
    let entry = |row: &Vec<f64>, j: usize| row.iter().zip(b).map(|(x, row)| x * row[j]).sum();
    a.iter().map(|row| (0..b[0].len()).map(|j| entry(row, j)).collect()).collect()
}

/// X with A X = B, and the determinant of A, by Gauss's elimination with pivots.
pub fn solved(a: &Matrix, b: &Matrix) -> (Matrix, f64) {
    let n = a.len();
    let mut rows: Matrix = a.iter().zip(b).map(|(a, b)| [&a[..], &b[..]].concat()).collect();
    let mut determinant = 1.0;
    for i in 0..n {
        let pivot = (i..n).max_by(|&p, &q| rows[p][i].abs().total_cmp(&rows[q][i].abs())).unwrap();
        if pivot != i {
            rows.swap(i, pivot);
            determinant = -determinant;
        }
        determinant *= rows[i][i];
        for j in (0..n).filter(|&j| j != i) {
            let factor = rows[j][i] / rows[i][i];
            let row = rows[i].clone();
            rows[j].iter_mut().zip(&row).for_each(|(x, y)| *x -= factor * y);
        }
    }
    for (i, row) in rows.iter_mut().enumerate() {
        let pivot = row[i];
        row.iter_mut().for_each(|x| *x /= pivot);
    }
    (rows.into_iter().map(|row| row[n..].to_vec()).collect(), determinant)
}
